//! The order of the search: single explanations, what they leave, pairs.

use super::findings::Findings;
use super::found::{Found, fitted, improve, sort};
use super::noise::{instead_of_second, with_noise};
use super::pairs::{FIRST, SINGLES, alone, pairs};
use super::search::{Breadth, FEW, leave_valleys, listed, unknown};
use super::terms::{Terms, of_keys, on_top, scales};
use crate::diagnose::settings::DiagnoseSettings;
use crate::diagnose::thresholds::Thresholds;
use crate::hypothesis::model::Model;
use crate::hypothesis::term::Term;
use crate::progress::{Progress, Stage};
use crate::study::StudyError;
use rayon::prelude::*;
use std::sync::Arc;

/// Steps of the search that are reported: functions, effects, noise, what effects leave, pairs.
pub(in crate::diagnose) const STEPS: usize = 5;

/// Looks for what explains the records alone: unknown functions, listed effects. `inside` is the twin with θ inside its prior, if its fit has
/// left it.
pub(in crate::diagnose) fn singles(
    base: &Model,
    inside: Option<&Model>,
    terms: &Terms<'_>,
    before: Before<'_>,
    settings: &DiagnoseSettings,
    stage: &Stage,
) -> Result<Singles, StudyError> {
    let breadth = Breadth::of(base, settings.quick);
    match before {
        Before::Nothing => one_by_one(base, inside, terms, breadth, stage),
        Before::Worse(old, origin) => beside_better(old, origin, base, terms, breadth, stage),
        Before::OtherStep(old, origin) => carried_on(old, origin, base, terms, breadth, stage),
    }
}

/// Adds other kinds of noise to single explanations, what those leave, and pairs; stops early where nothing is missing.
pub(in crate::diagnose) fn explore(
    found: Singles,
    base: &Model,
    terms: &Terms<'_>,
    settings: &DiagnoseSettings,
    stage: &Stage,
) -> Result<Findings, StudyError> {
    let breadth = Breadth::of(base, settings.quick);
    let Singles { findings, carried } = found;
    let (mut findings, several) = match carried {
        Some(Carried {
            several,
            noise,
            noise_pairs,
        }) => (
            Findings {
                noise,
                noise_pairs,
                ..findings
            },
            Some(several),
        ),
        None => {
            let mut findings = findings;
            wider(base, terms, breadth, &mut findings)?;
            (with_noise(base, terms, breadth, findings)?, None)
        }
    };
    findings.is_partial = settings.ends(stage.tick())?;
    if !settings.detection_only && !findings.is_partial {
        findings = beside_each_other(findings, base, terms, breadth, several, settings, stage)?;
    }
    Ok(findings)
}

/// Single explanations.
pub(in crate::diagnose) struct Singles {
    pub findings: Findings,
    /// Those that a search with another step found beside them.
    carried: Option<Carried>,
}

/// Pairs, and other kinds of noise.
struct Carried {
    several: Vec<Found>,
    noise: Vec<Found>,
    noise_pairs: Vec<Found>,
}

/// Knowledge from a search before.
#[derive(Clone, Copy)]
pub(in crate::diagnose) enum Before<'k> {
    Nothing,
    /// Findings beside a worse fit of the same twin, and log Z of that: its fits are kept unless new ones are better.
    Worse(&'k Findings, f64),
    /// Findings beside the same twin with another step, and log Z of that twin: their fits are carried on.
    OtherStep(&'k Findings, f64),
}

/// Single explanations beside a better fit of the twin: fits from the prior's centre and from loud noise stay as they are, the others are begun
/// again.
fn beside_better(
    old: &Findings,
    old_origin: f64,
    base: &Model,
    terms: &Terms<'_>,
    breadth: Breadth,
    stage: &Stage,
) -> Result<Singles, StudyError> {
    let origin = base.log_evidence;
    let kept = |all: &[Found]| -> Vec<Found> {
        let shifted = all.iter().cloned().map(|f| f.beside(old_origin, origin));
        fitted(shifted.collect()).collect()
    };
    let mut functions = unknown(base, &(terms.unknown)(&[]), origin, breadth.few())?;
    improve(&mut functions, kept(&old.unknown));
    stage.tick()?;
    let mut effects = listed(base, terms.listed, origin, &[], breadth.of_all())?;
    improve(&mut effects, kept(&old.listed));
    leave_valleys(base, &mut effects, origin)?;
    sort(&mut effects);
    stage.tick()?;
    Ok(Singles::alone(functions, effects))
}

/// Carries the fits that are known with another step on from where they ended: single explanations, and pairs.
fn carried_on(
    old: &Findings,
    old_origin: f64,
    base: &Model,
    terms: &Terms<'_>,
    breadth: Breadth,
    stage: &Stage,
) -> Result<Singles, StudyError> {
    let origin = base.log_evidence;
    let kept = |found: &Found| found.promised().beside(old_origin, origin);
    // What does not stand out keeps its evidence: another step does not help it more than the others.
    let least = FIRST * old.top();
    let carry = |found: &Found| -> Result<Found, StudyError> {
        let mut carried = kept(found);
        if let Some(old) = found.model.as_ref().filter(|_| found.gain > least)
            && let Some(new) = old.beside_twin(base)?
        {
            carried.gain += new.log_evidence - old.log_evidence;
            carried.model = Some(new);
        }
        Ok(carried)
    };
    let carry_all = |all: &[Found]| -> Result<Vec<Found>, StudyError> {
        let mut all: Vec<Found> = all.par_iter().map(carry).collect::<Result<_, _>>()?;
        sort(&mut all);
        Ok(all)
    };
    let last = |all: &[Found]| all.iter().map(|f| f.last().key()).collect::<Vec<String>>();
    let best = last(&old.unknown[..old.unknown.len().min(FEW)]);
    let seen = scales(&old.listed[..old.listed.len().min(2)])?;
    let best = of_keys(&(terms.unknown)(&seen), &best);
    let mut functions = unknown(base, &best, origin, breadth.few())?;
    let others = old.unknown.iter().filter(|found| {
        let again = functions.iter().any(|f| f.keys() == found.keys());
        !again
    });
    functions.extend(others.map(kept).collect::<Vec<_>>());
    sort(&mut functions);
    stage.tick()?;
    let mut effects = carry_all(&old.listed)?;
    // Those that stand out are fitted afresh, too: the other step's error may have led them astray.
    let near: Vec<Found> = (effects.iter().take(SINGLES))
        .filter(|found| found.gain > least)
        .cloned()
        .collect();
    let best = of_keys(terms.listed, &last(&near));
    improve(&mut effects, listed(base, &best, origin, &[], breadth)?);
    stage.tick()?;
    Ok(Singles {
        carried: Some(Carried {
            several: carry_all(&old.several)?,
            noise: old.noise.iter().map(kept).collect(),
            noise_pairs: old.noise_pairs.iter().map(kept).collect(),
        }),
        ..Singles::alone(functions, effects)
    })
}

impl Singles {
    fn alone(unknown: Vec<Found>, listed: Vec<Found>) -> Self {
        Self {
            findings: Findings {
                listed,
                unknown,
                ..Findings::default()
            },
            carried: None,
        }
    }
}

/// Unknown functions and effects alone.
fn one_by_one(
    base: &Model,
    inside: Option<&Model>,
    terms: &Terms<'_>,
    breadth: Breadth,
    stage: &Stage,
) -> Result<Singles, StudyError> {
    let origin = base.log_evidence;
    let first = (terms.unknown)(&[]);
    let mut unknown_alone = unknown(base, &first, origin, breadth)?;
    if let Some(inside) = inside {
        let others = unknown(inside, &first, origin, breadth.few())?;
        improve(&mut unknown_alone, fitted(others));
    }
    stage.tick()?;
    let best = unknown_alone.first().map_or(0.0, |f| f.gain);
    let breadth = breadth.for_gap(best);
    let looked = match best > Thresholds::NULL_LIKE {
        true => breadth.of_all(),
        false => breadth,
    };
    // A fit that has nothing to answer for is where it should be.
    let afresh = |breadth: Breadth, top: f64| match top > Thresholds::NULL_LIKE {
        true => breadth.afresh(),
        false => breadth,
    };
    let alone = |breadth: Breadth, top: f64| -> Result<Vec<Found>, StudyError> {
        let mut all = listed(base, terms.listed, origin, &[], afresh(breadth, top))?;
        if let Some(inside) = inside {
            let others = listed(inside, terms.listed, origin, &[], breadth)?;
            improve(&mut all, fitted(others));
        }
        Ok(all)
    };
    let mut effects = alone(looked, best)?;
    let top = effects.first().map_or(0.0, |f| f.gain);
    if best <= Thresholds::NULL_LIKE && top > Thresholds::NULL_LIKE {
        effects = alone(breadth.of_all(), top)?;
    }
    stage.tick()?;
    Ok(Singles::alone(unknown_alone, effects))
}

/// Functions of the range that the corrected twin goes through, which the misfitted one may not.
fn wider(
    base: &Model,
    terms: &Terms<'_>,
    breadth: Breadth,
    findings: &mut Findings,
) -> Result<(), StudyError> {
    if findings.top() <= Thresholds::WIDER {
        return Ok(());
    }
    let seen = scales(&findings.listed[..findings.listed.len().min(2)])?;
    let terms = (terms.unknown)(&seen);
    let wider = unknown(base, &terms, base.log_evidence, breadth.few())?;
    improve(&mut findings.unknown, fitted(wider));
    Ok(())
}

/// Adds what single effects leave, and pairs, which are searched unless they are given; stops where nothing is missing.
fn beside_each_other(
    mut findings: Findings,
    base: &Model,
    terms: &Terms<'_>,
    breadth: Breadth,
    several: Option<Vec<Found>>,
    settings: &DiagnoseSettings,
    stage: &Stage,
) -> Result<Findings, StudyError> {
    if explains_nothing_more(&findings) {
        return Ok(findings);
    }
    let (origin, top) = (base.log_evidence, findings.top());
    let may_suffice = may_suffice(&findings);
    let breadth = breadth.for_gap(findings.best_unknown());
    let few = breadth.few();
    let mut enough = false;
    // With pairs known, what is left is asked at the end alone.
    let asked = if several.is_none() { SINGLES } else { 0 };
    for i in 0..findings.listed.len().min(asked) {
        let found = findings.listed[i].clone();
        if found.gain < top - Thresholds::CANDIDATES || !may_suffice(&found) {
            break;
        }
        if findings.add(&found, on_top(&found, terms, origin, few)?) {
            enough = true;
            break;
        }
    }
    findings.is_partial = settings.ends(stage.tick())?;
    if findings.is_partial {
        return Ok(findings);
    }
    // What noise does in a second effect's place, a step before has told.
    let asks_for_noise = several.is_none();
    findings.several = match several {
        Some(several) => several,
        None if breadth.pairs => pairs(&findings, terms, origin, breadth, enough)?,
        None => vec![],
    };
    alone(base, &mut findings, terms, origin, breadth)?;
    if asks_for_noise && let Some(beside) = instead_of_second(&findings, terms, origin, breadth)? {
        findings.noise_beside = Some(beside);
    }
    findings.is_partial = settings.ends(stage.tick())?;
    Ok(findings)
}

/// Adds what pairs leave, and the best effect if that is not yet known: the last step, once the twin stays as it is.
pub(in crate::diagnose) fn what_is_left(
    mut findings: Findings,
    base: &Model,
    terms: &Terms<'_>,
    settings: &DiagnoseSettings,
    progress: &Progress,
) -> Result<Findings, StudyError> {
    if settings.detection_only || explains_nothing_more(&findings) {
        return Ok(findings);
    }
    let stage = progress.stage("what is left", 1);
    let origin = base.log_evidence;
    let may_suffice = may_suffice(&findings);
    let few = (Breadth::of(base, settings.quick).for_gap(findings.best_unknown())).few();
    let mut enough = findings.some_suffices();
    let is_new = |findings: &Findings| {
        (findings.listed.first().cloned()).filter(|best| findings.left(&best.keys()).is_none())
    };
    if let Some(best) = is_new(&findings).filter(&may_suffice) {
        enough |= findings.add(&best, on_top(&best, terms, origin, few)?);
    }
    let best_pair = findings.several.first().map_or(0.0, |pair| pair.gain);
    for i in 0..findings.several.len().min(2) {
        let found = findings.several[i].clone();
        let is_near = may_suffice(&found) && found.gain > best_pair - Thresholds::CANDIDATES;
        if !findings.wins(&found) || i > 0 && !is_near {
            break;
        }
        if findings.add(&found, on_top(&found, terms, origin, few)?) {
            enough = true;
            break;
        }
    }
    // What explains most may do so beside something unknown, which is also a rival of the second effect of a pair.
    if let Some(best) = is_new(&findings).filter(|_| !enough) {
        findings.add(&best, on_top(&best, terms, origin, few)?);
    }
    let pair = (findings.several.first()).filter(|pair| findings.wins(pair));
    let first = pair.and_then(|pair| findings.likelier_of(pair)).cloned();
    if let Some(first) = first.filter(|first| findings.left(&first.keys()).is_none()) {
        findings.add(&first, on_top(&first, terms, origin, few)?);
    }
    // A function may speak for a rival of the best effect.
    if let Some(rival) = findings.likeliest_single().cloned()
        && findings.left(&rival.keys()).is_none()
    {
        findings.add(&rival, on_top(&rival, terms, origin, few)?);
    }
    findings.is_partial = settings.ends(stage.tick())?;
    Ok(findings)
}

/// Returns whether the search ends with single explanations: nothing is missing, or another kind of noise comes first. Where that explains
/// as much as one effect, two may explain more.
fn explains_nothing_more(findings: &Findings) -> bool {
    findings.log_odds_alone() <= Thresholds::GAP || findings.asks_beside()
}

/// Tells effects that may leave nothing: what an unknown function alone explains better leaves something.
fn may_suffice(findings: &Findings) -> impl Fn(&Found) -> bool + use<> {
    let least = findings.best_unknown() - Thresholds::CANDIDATES;
    move |found| found.gain > least
}

/// Listed effects that explain a parameter gap with θ inside the prior, as well as θ outside does: best first.
pub(in crate::diagnose) fn absorbing(
    free: &Model,
    within: &Model,
    terms: &[Arc<Term>],
) -> Result<Vec<Found>, StudyError> {
    let breadth = Breadth::of(within, false).of_all();
    let found = listed(within, terms, within.log_evidence, &[], breadth)?;
    let best = free.fitted.log_likelihood - Thresholds::ABSORBS;
    let explains = |f: &Found| {
        f.model
            .as_ref()
            .is_some_and(|m| m.fitted.log_likelihood >= best)
    };
    Ok(found.into_iter().filter(explains).collect())
}
