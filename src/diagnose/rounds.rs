//! Rounds of the search: the twin as it is, with another kind of noise, with a finer step.

use super::answer::Posterior;
use super::base::Base;
use super::candidates::{not_tested, outliers};
use super::explain::explore::{Before, STEPS, explore, singles, what_is_left};
use super::explain::findings::Findings;
use super::explain::search::{Breadth, listed};
use super::explain::terms::Terms;
use super::settings::{Ablation, DiagnoseSettings};
use super::step::{FinerStep, finer_step};
use super::thresholds::Thresholds;
use crate::hypothesis::model::Model;
use crate::hypothesis::noise::kinds;
use crate::hypothesis::scales::Scales;
use crate::hypothesis::shared;
use crate::hypothesis::term::Term;
use crate::hypothesis::unknown::unknown;
use crate::likelihood::measured;
use crate::progress::Progress;
use crate::record::Record;
use crate::study::{Study, StudyError};
use rayon::prelude::*;
use std::sync::Arc;

/// Share of the best effect's evidence below which what a finer step explains does not change which effects stand out.
const MINOR: f64 = 1.0 / 3.0;
/// Explanations of each kind that are carried on with a finer step before a search with it.
const CARRIED: usize = 3;
/// Most kinds of noise that are added to the twin's own.
const ROUNDS: usize = 2;

/// A finer step, and θ beside explanations without it.
struct Finer {
    step: FinerStep,
    thetas: Vec<Vec<f64>>,
}

/// Everything that is known once the search is over.
pub(in crate::diagnose) struct Explored<'s> {
    pub study: &'s Study,
    pub base: &'s Base,
    pub listed: &'s [Arc<Term>],
    pub findings: Findings,
    pub posterior: Posterior,
    pub not_tested: Vec<String>,
    /// Rows that the search saw, where it did not see all.
    pub searched: Option<usize>,
}

impl Explored<'_> {
    /// log of the evidence of all hypotheses together.
    fn log_evidence(&self) -> f64 {
        self.base.model.log_evidence + self.posterior.log_evidence
    }
}

/// Fits the twin, searches for what explains the records beside it, and hands it all on.
pub(in crate::diagnose) fn search<R>(
    study: &Study,
    records: &Arc<[Record]>,
    settings: &DiagnoseSettings,
    progress: &Progress,
    then: &dyn Fn(Explored<'_>) -> Result<R, StudyError>,
) -> Result<R, StudyError> {
    let stage = progress.stage("fit", 1);
    let measured = measured(study.twin(), records, &settings.beliefs(study))?;
    let base = Base::new(&measured, records.clone(), settings)?;
    stage.tick()?;
    if let Some(step) = step_of(study, &base, settings)? {
        let (nothing, thetas) = (Before::Nothing, vec![]);
        let finer = Finer { step, thetas };
        return with_step(study, &base, finer, nothing, settings, progress, then);
    }
    let then = |mut own: Explored<'_>| {
        match likelier_with_step(&own, settings, progress, then) {
            // A twin that its own step holds together may go nowhere with a finer one.
            Ok(None) | Err(StudyError::NoStart) => {}
            Ok(Some(found)) => return Ok(found),
            Err(StudyError::Cancelled(_)) if settings.give_partial => {
                own.findings.is_partial = true;
            }
            Err(error) => return Err(error),
        }
        then(own)
    };
    let nothing = Before::Nothing;
    explored(study, base, nothing, settings, ROUNDS, progress, &then)
}

/// Searches with a finer step, too, where effects explain what the step may explain as well: they may imitate its error. `None` where the
/// step does not show, or where its hypotheses are together no likelier.
fn likelier_with_step<R>(
    own: &Explored<'_>,
    settings: &DiagnoseSettings,
    progress: &Progress,
    then: &dyn Fn(Explored<'_>) -> Result<R, StudyError>,
) -> Result<Option<R>, StudyError> {
    if own.base.step.is_some()
        || own.findings.is_partial
        || own.posterior.log_odds <= Thresholds::GAP
    {
        return Ok(None);
    }
    let top = own.findings.top();
    let least = Thresholds::STEP_SHOWS.max(Thresholds::FINE_PRINT * top);
    let Some((step, _)) = finer_step(&own.base.model, least, top)? else {
        return Ok(None);
    };
    if !helps_explanations(own, step)? {
        return Ok(None);
    }
    let least = own.log_evidence() + Thresholds::STEP_WINS;
    let then = |other: Explored<'_>| {
        let is_likelier = other.log_evidence() > least;
        is_likelier.then(|| then(other)).transpose()
    };
    let (nothing, thetas) = (Before::Nothing, own.findings.thetas());
    let finer = Finer { step, thetas };
    with_step(
        own.study, own.base, finer, nothing, settings, progress, &then,
    )
}

/// Returns whether the twin or one of the best explanations, each carried on with a finer step, is likelier than all are with their own.
fn helps_explanations(own: &Explored<'_>, step: FinerStep) -> Result<bool, StudyError> {
    let model = &own.base.model;
    let Some(twin) = step.of(&model.base) else {
        return Ok(false);
    };
    let findings = &own.findings;
    let all = [&findings.listed, &findings.unknown, &findings.several];
    let best =
        (all.iter()).flat_map(|all| all.iter().filter_map(|f| f.model.clone()).take(CARRIED));
    let known: Vec<Model> = std::iter::once(model.clone()).chain(best).collect();
    let log_evidence = |model: &Model| model.log_evidence;
    let least = known
        .iter()
        .map(log_evidence)
        .fold(f64::NEG_INFINITY, f64::max);
    let finer: Vec<bool> = (known.par_iter())
        .map(|model| {
            let problem = model.problem_of(&twin)?;
            let finer = Model {
                problem,
                ..model.clone()
            }
            .carried_on()?;
            Ok(finer.is_some_and(|finer| finer.log_evidence > least))
        })
        .collect::<Result<_, StudyError>>()?;
    Ok(finer.contains(&true))
}

/// The finer step that the records ask for. A gap may pass for one: an effect that is more probable, as one of all that are listed, is
/// asked first.
fn step_of(
    study: &Study,
    base: &Base,
    settings: &DiagnoseSettings,
) -> Result<Option<FinerStep>, StudyError> {
    let least = Thresholds::STEP_SHOWS;
    let Some((step, gain)) = finer_step(&base.model, least, 0.0)? else {
        return Ok(None);
    };
    let model = &base.model;
    let terms = base.listed(study, settings)?;
    let breadth = Breadth {
        listed: 2,
        ..Breadth::of(model, settings.quick)
    };
    let effects = listed(model, &terms, model.log_evidence, &[], breadth)?;
    let price = (effects.len() as f64 / Thresholds::LISTED).ln();
    let best = (effects.first()).filter(|effect| effect.gain - price > gain);
    match best.and_then(|effect| effect.model.as_ref()) {
        Some(beside) => Ok(finer_step(beside, least, 0.0)?.map(|(step, _)| step)),
        None => Ok(Some(step)),
    }
}

/// Fits the twin with a finer step, and searches with it; where it matters little beside what was found, goes on from that.
fn with_step<R>(
    study: &Study,
    base: &Base,
    finer: Finer,
    before: Before<'_>,
    settings: &DiagnoseSettings,
    progress: &Progress,
    then: &dyn Fn(Explored<'_>) -> Result<R, StudyError>,
) -> Result<R, StudyError> {
    let records = &base.model.problem.records;
    let twin = finer.step.of(study.twin());
    let twin = twin.as_ref().unwrap_or(study.twin());
    let measured = measured(twin, records, &settings.beliefs(study))?;
    let begin = DiagnoseSettings {
        initial: Some(base.theta.clone()),
        ..settings.clone()
    };
    let passes = base.model.problem.passes();
    let base = Base {
        step: Some(finer.step),
        ..Base::counted(&measured, records.clone(), &begin, passes)?
    };
    let better = base.fitted_from(&finer.thetas)?;
    let base = better.unwrap_or(base);
    explored(study, base, before, settings, ROUNDS, progress, then)
}

/// Searches for what explains the records beside a fitted twin, from what is known with another step where that is given; again where
/// they ask for another kind of noise, or for a finer step.
fn explored<R>(
    study: &Study,
    base: Base,
    before: Before<'_>,
    settings: &DiagnoseSettings,
    rounds: usize,
    progress: &Progress,
    then: &dyn Fn(Explored<'_>) -> Result<R, StudyError>,
) -> Result<R, StudyError> {
    let library = base.library();
    let effects = base.listed(study, settings)?;
    let mut noise = match rounds {
        0 => vec![],
        _ => shared(kinds(
            &outliers(study, &settings.without),
            &library,
            &base.noisy,
        )?),
    };
    noise.retain(|term| !base.noises.iter().any(|own| own.key() == term.key()));
    let unlisted = |seen: &[Scales]| match settings.lacks(Ablation::UnknownFunctions) {
        true => vec![],
        false => shared(unknown(&library, seen)),
    };
    let terms = Terms {
        listed: &effects,
        noise: &noise,
        unknown: &unlisted,
    };
    let stage = progress.stage("explain", STEPS);
    let inside = base.inside()?;
    let alone = singles(
        &base.model,
        inside.as_ref(),
        &terms,
        before,
        settings,
        &stage,
    )?;
    // Beside an explanation the twin's own fit may have gone further than it went.
    let better = base.fitted_from(&alone.findings.thetas())?;
    let mut findings = match better {
        None => explore(alone, &base.model, &terms, settings, &stage)?,
        Some(better) => {
            let before = Before::Worse(&alone.findings, base.model.log_evidence);
            match explored(study, better, before, settings, rounds, progress, then) {
                Err(StudyError::Cancelled(_)) if settings.give_partial => Findings {
                    is_partial: true,
                    ..alone.findings
                },
                found => return found,
            }
        }
    };
    stage.finish();
    if !findings.is_partial {
        match again(study, &base, &findings, settings, rounds, progress, then) {
            Ok(Some(found)) => return Ok(found),
            Ok(None) => {}
            Err(StudyError::Cancelled(_)) if settings.give_partial => findings.is_partial = true,
            Err(error) => return Err(error),
        }
    }
    if !findings.is_partial {
        findings = what_is_left(findings, &base.model, &terms, settings, progress)?;
    }
    then(Explored {
        study,
        posterior: findings.posterior(),
        findings,
        base: &base,
        listed: &effects,
        not_tested: not_tested(study, &effects),
        searched: None,
    })
}

/// Searches again where the fit of the twin had stopped early, or with the noise or the finer step that the findings ask for; `None` where
/// nothing of that holds.
fn again<R>(
    study: &Study,
    base: &Base,
    findings: &Findings,
    settings: &DiagnoseSettings,
    rounds: usize,
    progress: &Progress,
    then: &dyn Fn(Explored<'_>) -> Result<R, StudyError>,
) -> Result<Option<R>, StudyError> {
    if let Some(better) = base.fitted_from(&findings.thetas())? {
        let before = Before::Worse(findings, base.model.log_evidence);
        return explored(study, better, before, settings, rounds, progress, then).map(Some);
    }
    if let Some(model) = findings.asks_for_noise().and_then(|f| f.model.as_ref()) {
        if let Some(noisier) = base.with_noise(model)? {
            let before = Before::Nothing;
            return explored(study, noisier, before, settings, rounds - 1, progress, then)
                .map(Some);
        }
    }
    // Beside a gap, noise levels are fitted loud, and hide the step, or that a finer one is still too long. A second effect may imitate
    // its error, and so may an effect that explains a little more than the right one.
    for model in findings.candidates().filter_map(|f| f.model.as_ref()) {
        let finer = finer_step(model, Thresholds::STEP_SHOWS, findings.top())?;
        let Some((step, gain)) = finer.filter(|(step, _)| base.step != Some(*step)) else {
            continue;
        };
        let minor = gain < MINOR * findings.top() && base.noises.is_empty();
        let before = match minor {
            true => Before::OtherStep(findings, base.model.log_evidence),
            false => Before::Nothing,
        };
        let thetas = findings.thetas();
        let finer = Finer { step, thetas };
        return with_step(study, base, finer, before, settings, progress, then).map(Some);
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use crate::diagnose::fixture::{biased_record, tanks};
    use crate::diagnose::{DiagnoseSettings, Verdict, diagnose};
    use crate::progress::{Listener, Progress};
    use crate::study::StudyError;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};

    /// Stops the work once effects were tried one at a time.
    #[derive(Default)]
    struct Impatient(AtomicBool);

    impl Listener for Impatient {
        fn advanced(&self, stage: &str, done: u64, _: u64) {
            self.0
                .fetch_or(stage == "explain" && done >= 3, Ordering::Relaxed);
        }
        fn cancelled(&self) -> bool {
            self.0.load(Ordering::Relaxed)
        }
    }

    #[test]
    fn a_cancelled_search_gives_what_was_found() {
        let study = tanks(150);
        let records = [biased_record(&study, 2.0, 5)];
        let found = |give_partial| {
            let settings = DiagnoseSettings {
                give_partial,
                ..DiagnoseSettings::default()
            };
            let progress = Progress::new(Arc::new(Impatient::default()));
            diagnose(&study, &records, None, &settings, &progress)
        };
        let partial = found(true).unwrap();
        assert!(partial.interrupted && partial.quick);
        assert_eq!(partial.verdict, Verdict::StructuralGap);
        assert!(partial.cause.effects.iter().any(|e| e.id == "sensor-bias"));
        assert!(matches!(found(false), Err(StudyError::Cancelled(_))));
    }
}
