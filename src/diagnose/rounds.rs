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
use std::sync::Arc;

/// Share of the best effect's evidence below which what a finer step explains does not change which effects stand out.
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

/// Fits the twin, searches for what explains the records beside it, and hands it all on.
pub(in crate::diagnose) fn search<R>(
    study: &Study,
    records: &[Record],
    settings: &DiagnoseSettings,
    progress: &Progress,
    then: impl FnOnce(Explored<'_, '_>) -> Result<R, DiagnoseError>,
) -> Result<R, DiagnoseError> {
    let stage = progress.stage("fit", 1);
    let measured = measured(study.twin(), records, &settings.beliefs(study))?;
    let base = Base::new(&measured, records, settings)?;
    stage.tick()?;
    match step_of(study, &base, settings)? {
        Some(step) => with_step(study, &base, step, None, settings, progress, then),
        None => explored(study, base, None, settings, ROUNDS, progress, then),
    }
}

/// The finer step that the records ask for. A gap may pass for one: an effect that is more probable, as one of all that are listed, is
/// asked first.
fn step_of(
    study: &Study,
    base: &Base<'_>,
    settings: &DiagnoseSettings,
) -> Result<Option<FinerStep>, DiagnoseError> {
    let Some((step, gain)) = finer_step(&base.model)? else {
        return Ok(None);
    };
    let model = &base.model;
    let terms = base.listed(study, settings)?;
    let breadth = Breadth::of(model, settings.quick);
    let effects = listed(model, &terms, model.log_evidence, &[], breadth)?;
    let price = (effects.len() as f64 / Thresholds::LISTED).ln();
    let best = (effects.first()).filter(|effect| effect.gain - price > gain);
    match best.and_then(|effect| effect.model.as_ref()) {
        Some(beside) => Ok(finer_step(beside)?.map(|(step, _)| step)),
        None => Ok(Some(step)),
    }
}

/// Fits the twin with a finer step, and searches with it; where it matters little beside what was found, goes on from that.
fn with_step<R>(
    study: &Study,
    base: &Base<'_>,
    step: FinerStep,
    known: Option<Known<'_>>,
    settings: &DiagnoseSettings,
    progress: &Progress,
    then: impl FnOnce(Explored<'_, '_>) -> Result<R, DiagnoseError>,
) -> Result<R, DiagnoseError> {
    let records = base.model.problem.records;
    let twin = step.of(study.twin());
    let twin = twin.as_ref().unwrap_or(study.twin());
    let measured = measured(twin, records, &settings.beliefs(study))?;
    let begin = DiagnoseSettings {
        initial: Some(base.theta.clone()),
        ..settings.clone()
    };
    let base = Base {
        step: Some(step),
        ..Base::new(&measured, records, &begin)?
    };
    explored(study, base, known, settings, ROUNDS, progress, then)
}

/// Searches for what explains the records beside a fitted twin, from what is known with another step where that is given; again where
/// they ask for another kind of noise, or for a finer step.
fn explored<R>(
    study: &Study,
    base: Base<'_>,
    known: Option<Known<'_>>,
    settings: &DiagnoseSettings,
    rounds: usize,
    progress: &Progress,
    then: impl FnOnce(Explored<'_, '_>) -> Result<R, DiagnoseError>,
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
    let findings = explore(&base.model, &terms, breadth, known, explain, progress)?;
    if let Some(model) = findings.asks_for_noise().and_then(|f| f.model.as_ref()) {
        let twin = model.problem.twin.clone();
        if let Some(noisier) = base.with_noise(model, &twin)? {
            return explored(study, noisier, None, settings, rounds - 1, progress, then);
        }
    }
    // Beside a gap, noise levels are fitted loud, and hide the step.
    if let (None, Some(model)) = (base.step, findings.best_listed())
        && let Some((step, gain)) = finer_step(model)?
    {
        let minor = gain < MINOR * findings.top() && base.noises.is_empty();
        let known = minor.then_some(Known {
            findings: &findings,
            origin: base.model.log_evidence,
        });
        return with_step(study, &base, step, known, settings, progress, then);
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
