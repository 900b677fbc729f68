//! Rounds of the search: the twin as it is, with another kind of noise, with a finer step.

use super::base::Base;
use super::error::DiagnoseError;
use super::explain::explore::{Known, Terms, explore};
use super::explain::findings::{Chances, Findings};
use super::explain::search::{Breadth, listed};
use super::hypotheses::noise::kinds;
use super::hypotheses::scales::Scales;
use super::hypotheses::term::Term;
use super::hypotheses::{not_tested, shared, unknown};
use super::settings::{Ablation, DiagnoseSettings};
use super::step::{FinerStep, finer_step};
use super::thresholds::Thresholds;
use crate::likelihood::measured;
use crate::progress::Progress;
use crate::record::Record;
use crate::study::Study;
use std::cell::Cell;
use std::sync::Arc;

/// Share of the best effect's evidence below which what another step explains does not change which effects stand out.
const MINOR: f64 = 1.0 / 3.0;
/// Most kinds of noise that are added to the twin's own.
const ROUNDS: usize = 2;

/// Everything that is known once the search is over.
pub(in crate::diagnose) struct Explored<'s, 'a> {
    pub study: &'s Study,
    pub base: &'s Base<'a>,
    pub listed: &'s [Arc<Term>],
    pub findings: Findings<'a>,
    pub chances: Chances,
    pub not_tested: Vec<String>,
}

impl Explored<'_, '_> {
    /// log of the evidence of all hypotheses together.
    fn log_evidence(&self) -> f64 {
        self.base.model.log_evidence + self.chances.log_evidence
    }
}

/// Fits the twin, searches for what explains the records beside it, and hands it all on. Where its step shows, the same is done with a
/// finer one, and the search whose explanations are together likelier counts.
pub(in crate::diagnose) fn search<R>(
    study: &Study,
    records: &[Record],
    settings: &DiagnoseSettings,
    progress: &Progress,
    then: impl Fn(Explored<'_, '_>) -> Result<R, DiagnoseError>,
) -> Result<R, DiagnoseError> {
    let stage = progress.stage("fit", 1);
    let measured = measured(study.twin(), records, &settings.beliefs(study))?;
    let base = Base::new(&measured, records, settings)?;
    stage.tick()?;
    explored(study, base, None, settings, progress, &|mut own| {
        if !own.findings.is_partial
            && let Some(step) = finer(&own)?
        {
            let is_partial = Cell::new(false);
            let found = with_step(&own, step, settings, progress, &|other| {
                is_partial.set(other.findings.is_partial);
                let wins = other.log_evidence() - own.log_evidence() > Thresholds::STEP_WINS;
                wins.then(|| then(other)).transpose()
            });
            match found {
                // A twin that its own step holds together may go nowhere with a finer one.
                Ok(None) | Err(DiagnoseError::NoFit) => {}
                Ok(Some(found)) => return Ok(found),
                Err(DiagnoseError::Cancelled(_)) if settings.give_partial => is_partial.set(true),
                Err(error) => return Err(error),
            }
            own.findings.is_partial = is_partial.get();
        }
        then(own)
    })
}

/// The finer step that the records may ask for: beside a gap, noise levels are fitted loud, and hide it, unless the gap is explained.
fn finer(own: &Explored<'_, '_>) -> Result<Option<FinerStep>, DiagnoseError> {
    let explained = own.findings.top().max(0.0);
    match (
        finer_step(&own.base.model, explained)?,
        own.findings.best_listed(),
    ) {
        (None, Some(model)) => finer_step(model, explained),
        (step, _) => Ok(step),
    }
}

/// Fits the twin with a finer step and the same kinds of noise, and searches with it; `None` where nothing is missing with its own step and
/// a finer one explains no more.
fn with_step<R>(
    own: &Explored<'_, '_>,
    step: FinerStep,
    settings: &DiagnoseSettings,
    progress: &Progress,
    then: &dyn Fn(Explored<'_, '_>) -> Result<Option<R>, DiagnoseError>,
) -> Result<Option<R>, DiagnoseError> {
    let (study, model) = (own.study, &own.base.model);
    let records = model.problem.records;
    let twin = step.of(study.twin());
    let twin = twin.as_ref().unwrap_or(study.twin());
    let measured = measured(twin, records, &settings.beliefs(study))?;
    let begin = DiagnoseSettings {
        initial: Some(own.base.theta.clone()),
        ..settings.clone()
    };
    let base = Base {
        step: Some(step),
        ..Base::new(&measured, records, &begin)?
    };
    let gained = base.model.log_evidence - model.log_evidence;
    let (is_null, is_alone) = (
        own.chances.log_odds <= Thresholds::GAP,
        own.base.noises.is_empty(),
    );
    if is_null && is_alone && gained <= Thresholds::STEP_WINS {
        return Ok(None);
    }
    let is_minor = gained.abs() < MINOR * own.findings.top() && is_alone;
    let known = is_minor.then_some(Known {
        findings: &own.findings,
        origin: model.log_evidence,
    });
    with_noises(
        &own.base.noises,
        study,
        base,
        known,
        settings,
        progress,
        then,
    )
}

/// Adds kinds of noise to a fitted twin, and searches beside it.
fn with_noises<R>(
    noises: &[Arc<Term>],
    study: &Study,
    base: Base<'_>,
    known: Option<Known<'_>>,
    settings: &DiagnoseSettings,
    progress: &Progress,
    then: &dyn Fn(Explored<'_, '_>) -> Result<R, DiagnoseError>,
) -> Result<R, DiagnoseError> {
    if let Some((first, others)) = noises.split_first() {
        let (model, first) = (&base.model, std::slice::from_ref(first));
        let breadth = Breadth::of(model, settings.quick);
        let found = listed(model, first, model.log_evidence, &[], breadth)?;
        if let Some(model) = found.first().and_then(|found| found.model.as_ref()) {
            let twin = model.problem.twin.clone();
            if let Some(noisier) = base.with_noise(model, &twin)? {
                return with_noises(others, study, noisier, known, settings, progress, then);
            }
        }
    }
    explored(study, base, known, settings, progress, then)
}

/// Searches for what explains the records beside a fitted twin; again where they ask for another kind of noise.
fn explored<R>(
    study: &Study,
    base: Base<'_>,
    known: Option<Known<'_>>,
    settings: &DiagnoseSettings,
    progress: &Progress,
    then: &dyn Fn(Explored<'_, '_>) -> Result<R, DiagnoseError>,
) -> Result<R, DiagnoseError> {
    let library = base.library();
    let effects = base.listed(study, settings)?;
    let mut noise = match base.noises.len() < ROUNDS {
        false => vec![],
        true => shared(kinds(study, &settings.without, &library, &base.noisy)?),
    };
    noise.retain(|term| !base.noises.iter().any(|own| own.key() == term.key()));
    let unlisted = |seen: &[Scales<'_>]| match settings.lacks(Ablation::UnknownFunctions) {
        true => vec![],
        false => shared(unknown(&library, seen)),
    };
    let terms = Terms {
        listed: &effects,
        noise: &noise,
        unknown: &unlisted,
    };
    let mut findings = explore(&base.model, &terms, known, settings, progress)?;
    let asked = findings.asks_for_noise().and_then(|f| f.model.clone());
    if let Some(model) = asked.filter(|_| !findings.is_partial) {
        let twin = model.problem.twin.clone();
        if let Some(noisier) = base.with_noise(&model, &twin)? {
            // Beside a gap, the effects that stood out without that noise do so with it.
            let is_beside =
                (findings.noise_beside.as_ref()).is_some_and(|(_, nats)| *nats > Thresholds::NOISE);
            let known = is_beside.then_some(Known {
                findings: &findings,
                origin: base.model.log_evidence,
            });
            match explored(study, noisier, known, settings, progress, then) {
                Err(DiagnoseError::Cancelled(_)) if settings.give_partial => {
                    findings.is_partial = true;
                }
                found => return found,
            }
        }
    }
    then(Explored {
        study,
        chances: findings.chances(),
        findings,
        base: &base,
        listed: &effects,
        not_tested: not_tested(study, &effects),
    })
}

#[cfg(test)]
mod tests {
    use crate::diagnose::fixture::{biased_record, tanks};
    use crate::diagnose::{DiagnoseError, DiagnoseSettings, Verdict, diagnose};
    use crate::progress::{Listener, Progress};
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
        assert!(matches!(found(false), Err(DiagnoseError::Cancelled(_))));
    }
}
