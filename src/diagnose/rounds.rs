//! Rounds of the search: the twin as it is, with another kind of noise, with a finer step.

use super::base::Base;
use super::error::DiagnoseError;
use super::explain::explore::{Terms, explore};
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
use std::sync::Arc;

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
    explored(study, base, settings, ROUNDS, progress, |own| {
        if let Some(step) = finer(&own)? {
            let found = with_step(own.base, step, study, settings, progress, |other| {
                let wins = other.log_evidence() - own.log_evidence() > Thresholds::STEP_WINS;
                wins.then(|| then(other)).transpose()
            });
            match found {
                // A twin that its own step holds together may go nowhere with a finer one.
                Ok(None) | Err(DiagnoseError::NoFit) => {}
                Ok(Some(found)) => return Ok(found),
                Err(error) => return Err(error),
            }
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

/// Fits the twin with a finer step and the same kinds of noise, and searches with it.
fn with_step<R>(
    own: &Base<'_>,
    step: FinerStep,
    study: &Study,
    settings: &DiagnoseSettings,
    progress: &Progress,
    then: impl Fn(Explored<'_, '_>) -> Result<R, DiagnoseError>,
) -> Result<R, DiagnoseError> {
    let records = own.model.problem.records;
    let twin = step.of(study.twin());
    let twin = twin.as_ref().unwrap_or(study.twin());
    let measured = measured(twin, records, &settings.beliefs(study))?;
    let begin = DiagnoseSettings {
        initial: Some(own.theta.clone()),
        ..settings.clone()
    };
    let base = Base {
        step: Some(step),
        ..Base::new(&measured, records, &begin)?
    };
    with_noises(&own.noises, study, base, settings, progress, then)
}

/// Adds kinds of noise to a fitted twin, and searches beside it.
fn with_noises<R>(
    noises: &[Arc<Term>],
    study: &Study,
    base: Base<'_>,
    settings: &DiagnoseSettings,
    progress: &Progress,
    then: impl Fn(Explored<'_, '_>) -> Result<R, DiagnoseError>,
) -> Result<R, DiagnoseError> {
    let rounds = ROUNDS - base.noises.len().min(ROUNDS);
    if let Some((first, others)) = noises.split_first() {
        let (model, first) = (&base.model, std::slice::from_ref(first));
        let breadth = Breadth::of(model, settings.quick);
        let found = listed(model, first, model.log_evidence, &[], breadth)?;
        if let Some(model) = found.first().and_then(|found| found.model.as_ref()) {
            let twin = model.problem.twin.clone();
            if let Some(noisier) = base.with_noise(model, &twin)? {
                return with_noises(others, study, noisier, settings, progress, then);
            }
        }
    }
    explored(study, base, settings, rounds, progress, then)
}

/// Searches for what explains the records beside a fitted twin; again where they ask for another kind of noise.
fn explored<R>(
    study: &Study,
    base: Base<'_>,
    settings: &DiagnoseSettings,
    rounds: usize,
    progress: &Progress,
    then: impl Fn(Explored<'_, '_>) -> Result<R, DiagnoseError>,
) -> Result<R, DiagnoseError> {
    let library = base.library();
    let effects = base.listed(study, settings)?;
    let mut noise = match rounds {
        0 => vec![],
        _ => shared(kinds(study, &settings.without, &library, &base.noisy)?),
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
    let breadth = Breadth::of(&base.model, settings.quick);
    let explain = !settings.detection_only;
    let findings = explore(&base.model, &terms, breadth, explain, progress)?;
    if let Some(model) = findings.asks_for_noise().and_then(|f| f.model.as_ref()) {
        let twin = model.problem.twin.clone();
        if let Some(noisier) = base.with_noise(model, &twin)? {
            return explored(study, noisier, settings, rounds - 1, progress, then);
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
