//! The order of the search: single explanations, what they leave, pairs.

use super::findings::{Findings, leaves_nothing, suffices};
use super::found::{Found, own_theta, sort};
use super::search::{Breadth, FEW, listed, unknown};
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::hypotheses::scales::Scales;
use crate::diagnose::hypotheses::term::{Part, Term};
use crate::diagnose::model::Model;
use crate::diagnose::settings::DiagnoseSettings;
use crate::diagnose::thresholds::Thresholds;
use crate::progress::{Progress, Stage};
use rayon::prelude::*;
use std::sync::Arc;

/// Steps of the search that are reported: functions, effects, functions of the corrected twin, what is left, pairs.
const STEPS: usize = 5;
/// Single effects that are looked at for something left, or for a second one beside them.
const SINGLES: usize = 3;
/// Least share of the best single effect's evidence of a first of a pair.
const FIRST: f64 = 1.0 / 3.0;

/// Terms of a diagnosis.
pub(in crate::diagnose) struct Terms<'t> {
    pub listed: &'t [Arc<Term>],
    /// Kinds of noise other than the twin's.
    pub noise: &'t [Arc<Term>],
    /// Unknown functions whose range covers these models' states as well.
    pub unknown: &'t dyn Fn(&[Scales<'_>]) -> Vec<Arc<Term>>,
}

/// Finds out what explains the records beside the twin; stops early where nothing does.
pub(in crate::diagnose) fn explore<'a>(
    base: &Model<'a>,
    terms: &Terms<'_>,
    before: Before<'_, 'a>,
    settings: &DiagnoseSettings,
    progress: &Progress,
) -> Result<Findings<'a>, DiagnoseError> {
    let stage = progress.stage("explain", STEPS);
    let breadth = Breadth::of(base, settings.quick);
    let (mut findings, several) = match before {
        Before::Nothing => (one_by_one(base, terms, &[], breadth, &stage)?, None),
        Before::Worse(old) => (one_by_one(base, terms, &old.listed, breadth, &stage)?, None),
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
    terms: &Terms<'_>,
    old: &[Found<'a>],
    breadth: Breadth,
    stage: &Stage,
) -> Result<Findings<'a>, DiagnoseError> {
    let origin = base.log_evidence;
    let first = (terms.unknown)(&[]);
    let mut unknown_alone = unknown(base, &first, origin, breadth)?;
    stage.tick()?;
    let best = unknown_alone.first().map_or(0.0, |f| f.gain);
    let breadth = breadth.for_gap(best);
    let looked = match best > Thresholds::NULL_LIKE {
        true => breadth.of_all(),
        false => breadth,
    };
    let mut singles = listed(base, terms.listed, origin, &[], looked)?;
    let top = singles.first().map_or(0.0, |f| f.gain);
    if best <= Thresholds::NULL_LIKE && top > Thresholds::NULL_LIKE {
        singles = listed(base, terms.listed, origin, &[], breadth.of_all())?;
    }
    let refitted = old.iter().filter_map(|found| {
        let model = found.model.clone()?;
        Some(Found {
            terms: model.terms.clone(),
            gain: model.log_evidence - origin,
            model: Some(model),
        })
    });
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

/// Adds other kinds of noise to what was found alone.
fn with_noise<'a>(
    base: &Model<'a>,
    terms: &Terms<'_>,
    breadth: Breadth,
    singles: Vec<Found<'a>>,
    unknown: Vec<Found<'a>>,
) -> Result<Findings<'a>, DiagnoseError> {
    let (origin, every) = (base.log_evidence, breadth.of_all());
    let noise = listed(base, terms.noise, origin, &[], every)?;
    Ok(Findings {
        noise_pairs: noise_pairs(&noise, terms.noise, origin, every)?,
        noise,
        noise_beside: noise_beside(&singles, terms.noise, origin, every)?,
        listed: singles,
        unknown,
        ..Findings::default()
    })
}

/// Adds what single effects leave, pairs, which are searched unless they are given, and what these leave; stops where nothing is missing.
fn beside_each_other<'a>(
    mut findings: Findings<'a>,
    base: &Model<'a>,
    terms: &Terms<'_>,
    breadth: Breadth,
    several: Option<Vec<Found<'a>>>,
    settings: &DiagnoseSettings,
    stage: &Stage,
) -> Result<Findings<'a>, DiagnoseError> {
    // Where another kind of noise explains as much as one effect, two may explain more.
    if findings.log_odds_alone() <= Thresholds::GAP || findings.asks_beside() {
        return Ok(findings);
    }
    let (origin, top) = (base.log_evidence, findings.top());
    // What an unknown function alone explains better leaves something.
    let best = findings.unknown.first().map_or(0.0, |f| f.gain);
    let breadth = breadth.for_gap(best);
    let few = breadth.few();
    let may_suffice = |found: &Found<'_>| found.gain > best - Thresholds::CANDIDATES;
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
    if let Some(found) = alone(base, &mut findings, terms, origin, breadth)? {
        enough |= findings.add(&found, on_top(&found, terms, origin, few)?);
    }
    if asks_for_noise && let Some(beside) = instead_of_second(&findings, terms, origin, breadth)? {
        findings.noise_beside = Some(beside);
        if findings.asks_beside() {
            return Ok(findings);
        }
    }
    for i in 0..findings.several.len().min(2) {
        let found = findings.several[i].clone();
        if !findings.wins(&found) || i > 0 && !may_suffice(&found) {
            break;
        }
        if findings.add(&found, on_top(&found, terms, origin, few)?) {
            enough = true;
            break;
        }
    }
    findings.is_partial = settings.ends(stage.tick())?;
    // What explains most may do so beside something unknown.
    if !enough
        && let Some(found) = findings.listed.first().cloned()
        && findings.left(&found.keys()).is_none()
    {
        findings.add(&found, on_top(&found, terms, origin, few)?);
    }
    Ok(findings)
}

/// The outliers that are likeliest beside the best listed effect, at other sensors than its own. Correlated noise is not asked for here:
/// it would pass for what an effect leaves.
fn noise_beside<'a>(
    singles: &[Found<'a>],
    noise: &[Arc<Term>],
    origin: f64,
    breadth: Breadth,
) -> Result<Option<(String, f64)>, DiagnoseError> {
    let best = singles.first().filter(|f| f.gain > Thresholds::WIDER);
    let Some((best, model)) = best.and_then(|f| Some((f, f.model.as_ref()?))) else {
        return Ok(None);
    };
    let outliers: Vec<Arc<Term>> = (noise.iter())
        .filter(|term| matches!(term.part, Part::Effect { .. }))
        .filter(|term| term.target != best.last().target)
        .cloned()
        .collect();
    let found = listed(model, &outliers, origin, &[], breadth)?;
    Ok((found.first()).map(|f| (f.last().key(), f.gain - best.gain)))
}

/// The kind of noise that explains more beside one effect of the best pair than the other effect does, its price paid, and leaves nothing:
/// what remains beside an effect, noise would hide.
fn instead_of_second(
    findings: &Findings<'_>,
    terms: &Terms<'_>,
    origin: f64,
    breadth: Breadth,
) -> Result<Option<(String, f64)>, DiagnoseError> {
    let first = findings.several.first();
    let Some(pair) = first.filter(|pair| findings.wins(pair)) else {
        return Ok(None);
    };
    let keys = pair.keys();
    let mut best: Option<(Found<'_>, f64)> = None;
    for single in (findings.listed.iter()).filter(|f| keys.contains(&f.last().key())) {
        let Some(model) = &single.model else { continue };
        let found = listed(model, terms.noise, origin, &[], breadth.of_all())?;
        let Some(found) = found.into_iter().next() else {
            continue;
        };
        if best.as_ref().is_none_or(|(best, _)| found.gain > best.gain) {
            let gain = found.gain - single.gain;
            best = Some((found, gain));
        }
    }
    let enough = pair.gain - findings.price(2);
    let Some((found, gain)) = best.filter(|(found, _)| found.gain > enough) else {
        return Ok(None);
    };
    let on_top = on_top(&found, terms, origin, breadth.few())?;
    let is_enough = on_top.is_some_and(|on_top| suffices(&found, &on_top));
    Ok(is_enough.then(|| (found.last().key(), gain)))
}

/// Second kinds of noise beside the likeliest one.
fn noise_pairs<'a>(
    noise: &[Found<'a>],
    terms: &[Arc<Term>],
    origin: f64,
    breadth: Breadth,
) -> Result<Vec<Found<'a>>, DiagnoseError> {
    let best = noise.first().filter(|f| f.gain > Thresholds::NOISE);
    let Some((best, model)) = best.and_then(|f| Some((f, f.model.as_ref()?))) else {
        return Ok(vec![]);
    };
    let others: Vec<Arc<Term>> = (terms.iter())
        .filter(|term| term.key() != best.last().key())
        .cloned()
        .collect();
    listed(model, &others, origin, &[], breadth)
}

/// Unknown functions on top of fitted effects.
fn on_top<'a>(
    found: &Found<'a>,
    terms: &Terms<'_>,
    origin: f64,
    breadth: Breadth,
) -> Result<Option<Vec<Found<'a>>>, DiagnoseError> {
    let Some(model) = &found.model else {
        return Ok(None);
    };
    let seen = scales(std::slice::from_ref(found))?;
    Ok(Some(unknown(
        model,
        &(terms.unknown)(&seen),
        origin,
        breadth,
    )?))
}

/// Second effects on top of the best singles.
fn pairs<'a>(
    findings: &Findings<'a>,
    terms: &Terms<'_>,
    origin: f64,
    breadth: Breadth,
    enough: bool,
) -> Result<Vec<Found<'a>>, DiagnoseError> {
    let thetas: Vec<Vec<f64>> = findings
        .listed
        .iter()
        .take(2)
        .filter_map(own_theta)
        .collect();
    let mut all: Vec<Found<'a>> = vec![];
    let adequate = |f: &&Found<'a>| {
        let left = findings.left(&f.keys());
        left.is_some_and(|left| leaves_nothing(f.gain, left))
    };
    let stands_out = |f: &&Found<'a>| f.gain > FIRST * findings.top();
    let sources: Vec<&Found<'a>> = match enough {
        true => findings.listed.iter().find(adequate).into_iter().collect(),
        false => (findings.listed.iter().take(SINGLES))
            .filter(stands_out)
            .collect(),
    };
    for first in sources {
        let Some(model) = &first.model else { continue };
        let others: Vec<Arc<Term>> = (terms.listed.iter())
            .filter(|t| !first.terms.iter().any(|own| own.key() == t.key()))
            .cloned()
            .collect();
        let count = if enough { 4 } else { 8 };
        let seconds = Breadth {
            listed: count,
            annealed: count.min(breadth.annealed),
            least: 3.0,
            ..breadth
        };
        keep(&mut all, listed(model, &others, origin, &thetas, seconds)?);
    }
    // A pair that wins has rivals: the second effect beside the rivals of the first.
    if let Some(pair) = all.first().filter(|pair| findings.wins(pair)).cloned() {
        let second = &pair.terms[pair.terms.len() - 1..];
        let (keys, first) = (
            pair.keys(),
            findings.gain(&pair.keys()[..1]).unwrap_or(findings.top()),
        );
        let rivals = (findings.listed.iter())
            .filter(|f| f.gain > first - Thresholds::RIVALS && !keys.contains(&f.last().key()));
        for model in rivals.filter_map(|f| f.model.as_ref()).take(SINGLES) {
            keep(&mut all, listed(model, second, origin, &thetas, breadth)?);
        }
    }
    all.truncate(Thresholds::PAIRS);
    Ok(all)
}

/// A pair may win since the fits of its effects alone stopped early, or since one of the two stood for a coarse step: these begin again
/// where the pair ended. Returns the best single effect if it is a new one.
fn alone<'a>(
    base: &Model<'a>,
    findings: &mut Findings<'a>,
    terms: &Terms<'_>,
    origin: f64,
    breadth: Breadth,
) -> Result<Option<Found<'a>>, DiagnoseError> {
    let top = findings.top();
    let first = findings.several.first();
    let Some(pair) = first.filter(|pair| findings.wins(pair)) else {
        return Ok(None);
    };
    let keys = pair.keys();
    let own: Vec<Arc<Term>> = (terms.listed.iter())
        .filter(|term| keys.contains(&term.key()))
        .cloned()
        .collect();
    let thetas: Vec<Vec<f64>> = own_theta(pair).into_iter().collect();
    let again = listed(base, &own, origin, &thetas, breadth.of_all())?;
    improve(&mut findings.listed, again);
    Ok((findings.listed.first().cloned()).filter(|first| first.gain > top))
}

/// Takes the better ones of the same terms, and adds none; best first.
fn improve<'a>(all: &mut [Found<'a>], others: impl IntoIterator<Item = Found<'a>>) {
    for found in others {
        let keys = found.keys();
        let own = all.iter_mut().find(|own| own.keys() == keys);
        if let Some(own) = own.filter(|own| own.gain < found.gain) {
            *own = found;
        }
    }
    sort(all);
}

/// Adds fitted pairs, of two of the same effects the better one; best first.
fn keep<'a>(all: &mut Vec<Found<'a>>, found: Vec<Found<'a>>) {
    for pair in found.into_iter().filter(|f| f.model.is_some()) {
        let keys = pair.keys();
        let same = |p: &&mut Found<'a>| p.keys().iter().all(|k| keys.contains(k));
        match all.iter_mut().find(same) {
            Some(old) if old.gain >= pair.gain => {}
            Some(old) => *old = pair,
            None => all.push(pair),
        }
    }
    sort(all);
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

/// Sizes of the states along fitted models.
fn scales<'a>(found: &[Found<'a>]) -> Result<Vec<Scales<'a>>, DiagnoseError> {
    let mut all = vec![];
    for model in found.iter().filter_map(|f| f.model.as_ref()) {
        all.push(Scales {
            records: model.problem.records,
            states: model.states()?,
            outline: model.problem.outline(),
            rates: vec![],
            defined: vec![],
        });
    }
    Ok(all)
}
