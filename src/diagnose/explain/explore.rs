//! The order of the search: single explanations, what they leave, pairs.

use super::findings::Findings;
use super::found::{Found, fitted, improve, sort};
use super::noise::{instead_of_second, with_noise};
use super::pairs::{FIRST, SINGLES, alone, pairs};
use super::search::{Breadth, FEW, listed, unknown};
use super::terms::{Terms, on_top, scales};
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::hypotheses::term::Term;
use crate::diagnose::model::Model;
use crate::diagnose::settings::DiagnoseSettings;
use crate::diagnose::thresholds::Thresholds;
use crate::progress::{Progress, Stage};
use rayon::prelude::*;
use std::sync::Arc;

/// Steps of the search that are reported: functions, effects, noise, what effects leave, pairs.
const STEPS: usize = 5;

/// Finds out what explains the records beside the twin; stops early where nothing does. `inside` is the twin with θ inside its prior, if
/// its fit has left it.
pub(in crate::diagnose) fn explore<'a>(
    base: &Model<'a>,
    inside: Option<&Model<'a>>,
    terms: &Terms<'_>,
    before: Before<'_, 'a>,
    settings: &DiagnoseSettings,
    progress: &Progress,
) -> Result<Findings<'a>, DiagnoseError> {
    let stage = progress.stage("explain", STEPS);
    let breadth = Breadth::of(base, settings.quick);
    let (mut findings, several) = match before {
        Before::Nothing => (one_by_one(base, inside, terms, &[], breadth, &stage)?, None),
        Before::Worse(old) => (
            one_by_one(base, inside, terms, &old.listed, breadth, &stage)?,
            None,
        ),
        Before::OtherStep(old, origin) => carried_on(old, origin, base, terms, breadth, &stage)?,
    };
    findings.is_partial = settings.ends(stage.tick())?;
    if !settings.detection_only && !findings.is_partial {
        findings = beside_each_other(findings, base, terms, breadth, several, settings, &stage)?;
    }
    stage.finish();
    Ok(findings)
}

/// Knowledge from a search before.
#[derive(Clone, Copy)]
pub(in crate::diagnose) enum Before<'k, 'a> {
    Nothing,
    /// Findings beside a worse fit of the same twin: fits that are better than the new ones are kept.
    Worse(&'k Findings<'a>),
    /// Findings beside the same twin with another step, and log Z of that twin: their fits are carried on.
    OtherStep(&'k Findings<'k>, f64),
}

/// Carries the fits that are known with another step on from where they ended: single explanations, and pairs.
fn carried_on<'a>(
    old: &Findings<'_>,
    old_origin: f64,
    base: &Model<'a>,
    terms: &Terms<'_>,
    breadth: Breadth,
    stage: &Stage,
) -> Result<(Findings<'a>, Option<Vec<Found<'a>>>), DiagnoseError> {
    let origin = base.log_evidence;
    let kept = |found: &Found<'_>| Found {
        terms: found.terms.clone(),
        gain: found.gain + old_origin - origin,
        model: None,
    };
    // What does not stand out keeps its evidence: another step does not help it more than the others.
    let least = FIRST * old.top();
    let carry = |found: &Found<'_>| -> Result<Found<'a>, DiagnoseError> {
        let mut carried = kept(found);
        if let Some(old) = found.model.as_ref().filter(|_| found.gain > least)
            && let Some(new) = old.beside_twin(base)?
        {
            carried.gain += new.log_evidence - old.log_evidence;
            carried.model = Some(new);
        }
        Ok(carried)
    };
    let carry_all = |all: &[Found<'_>]| -> Result<Vec<Found<'a>>, DiagnoseError> {
        let mut all: Vec<Found<'a>> = all.par_iter().map(carry).collect::<Result<_, _>>()?;
        sort(&mut all);
        Ok(all)
    };
    let best: Vec<Arc<Term>> = (old.unknown.iter().take(FEW))
        .filter_map(|found| found.terms.last().cloned())
        .collect();
    let mut functions = unknown(base, &best, origin, breadth.few())?;
    let others = old.unknown.iter().filter(|found| {
        let again = functions.iter().any(|f| f.keys() == found.keys());
        !again
    });
    functions.extend(others.map(kept).collect::<Vec<_>>());
    sort(&mut functions);
    stage.tick()?;
    let mut singles = carry_all(&old.listed)?;
    // Those that stand out are fitted afresh, too: the other step's error may have led them astray.
    let best: Vec<Arc<Term>> = (singles.iter().take(SINGLES))
        .filter(|found| found.gain > least)
        .filter_map(|found| found.terms.last().cloned())
        .collect();
    improve(&mut singles, listed(base, &best, origin, &[], breadth)?);
    stage.tick()?;
    let findings = with_noise(base, terms, breadth, singles, functions)?;
    Ok((findings, Some(carry_all(&old.several)?)))
}

/// Unknown functions and effects alone, and other kinds of noise; `old` are fits of effects that may be better.
fn one_by_one<'a>(
    base: &Model<'a>,
    inside: Option<&Model<'a>>,
    terms: &Terms<'_>,
    old: &[Found<'a>],
    breadth: Breadth,
    stage: &Stage,
) -> Result<Findings<'a>, DiagnoseError> {
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
    let alone = |breadth: Breadth| -> Result<Vec<Found<'a>>, DiagnoseError> {
        let mut all = listed(base, terms.listed, origin, &[], breadth.afresh())?;
        if let Some(inside) = inside {
            let others = listed(inside, terms.listed, origin, &[], breadth)?;
            improve(&mut all, fitted(others));
        }
        Ok(all)
    };
    let mut singles = alone(looked)?;
    let top = singles.first().map_or(0.0, |f| f.gain);
    if best <= Thresholds::NULL_LIKE && top > Thresholds::NULL_LIKE {
        singles = alone(breadth.of_all())?;
    }
    let refitted =
        (old.iter().filter_map(|found| found.model.clone())).map(|model| Found::of(model, origin));
    improve(&mut singles, refitted);
    let top = singles.first().map_or(0.0, |f| f.gain);
    stage.tick()?;
    if top > Thresholds::WIDER {
        // The twin that is misfitted may not go where the corrected one goes.
        let seen = scales(&singles[..singles.len().min(2)])?;
        let wider = unknown(base, &(terms.unknown)(&seen), origin, breadth.few())?;
        improve(&mut unknown_alone, wider);
    }
    with_noise(base, terms, breadth, singles, unknown_alone)
}

/// Adds what single effects leave, and pairs, which are searched unless they are given; stops where nothing is missing.
fn beside_each_other<'a>(
    mut findings: Findings<'a>,
    base: &Model<'a>,
    terms: &Terms<'_>,
    breadth: Breadth,
    several: Option<Vec<Found<'a>>>,
    settings: &DiagnoseSettings,
    stage: &Stage,
) -> Result<Findings<'a>, DiagnoseError> {
    if explains_nothing_more(&findings) {
        return Ok(findings);
    }
    let (origin, top) = (base.log_evidence, findings.top());
    let may_suffice = may_suffice(&findings);
    let breadth = breadth.for_gap(findings.best_unknown());
    let few = breadth.few();
    let mut enough = false;
    for i in 0..findings.listed.len().min(SINGLES) {
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
pub(in crate::diagnose) fn what_is_left<'a>(
    mut findings: Findings<'a>,
    base: &Model<'a>,
    terms: &Terms<'_>,
    settings: &DiagnoseSettings,
    progress: &Progress,
) -> Result<Findings<'a>, DiagnoseError> {
    if settings.detection_only || explains_nothing_more(&findings) {
        return Ok(findings);
    }
    let stage = progress.stage("what is left", 1);
    let origin = base.log_evidence;
    let may_suffice = may_suffice(&findings);
    let few = (Breadth::of(base, settings.quick).for_gap(findings.best_unknown())).few();
    let mut enough = findings.some_suffices();
    let is_new = |findings: &Findings<'a>| {
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
    // What explains most may do so beside something unknown.
    let is_outdone = best_pair - findings.price(2) > findings.top() + Thresholds::CANDIDATES;
    if !enough
        && !is_outdone
        && let Some(best) = is_new(&findings)
    {
        findings.add(&best, on_top(&best, terms, origin, few)?);
    }
    findings.is_partial = settings.ends(stage.tick())?;
    Ok(findings)
}

/// Returns whether the search ends with single explanations: nothing is missing, or another kind of noise comes first. Where that explains
/// as much as one effect, two may explain more.
fn explains_nothing_more(findings: &Findings<'_>) -> bool {
    findings.log_odds_alone() <= Thresholds::GAP || findings.asks_beside()
}

/// Tells effects that may leave nothing: what an unknown function alone explains better leaves something.
fn may_suffice(findings: &Findings<'_>) -> impl Fn(&Found<'_>) -> bool + use<> {
    let least = findings.best_unknown() - Thresholds::CANDIDATES;
    move |found| found.gain > least
}

/// Listed effects that explain a parameter gap with θ inside the prior, as well as θ outside does: best first.
pub(in crate::diagnose) fn absorbing<'a>(
    free: &Model<'a>,
    within: &Model<'a>,
    terms: &[Arc<Term>],
) -> Result<Vec<Found<'a>>, DiagnoseError> {
    let breadth = Breadth::of(within, false).of_all();
    let found = listed(within, terms, within.log_evidence, &[], breadth)?;
    let best = free.fitted.log_likelihood - Thresholds::ABSORBS;
    let explains = |f: &Found<'a>| {
        f.model
            .as_ref()
            .is_some_and(|m| m.fitted.log_likelihood >= best)
    };
    Ok(found.into_iter().filter(explains).collect())
}
