//! The way of one diagnosis.

use crate::diagnose::context::Context;
use crate::diagnose::detect::{Detected, detect, explained};
use crate::diagnose::error::{DiagnoseError, GivenRecord};
use crate::diagnose::explain::attribute::Explanation;
use crate::diagnose::explain::decide::{Answer, decide};
use crate::diagnose::explain::step::{Accepted, Step};
use crate::diagnose::explain::verdict::absorbing;
use crate::diagnose::hypotheses::candidate::Addition;
use crate::diagnose::locate::location::{locate, maps};
use crate::diagnose::outcome::Maps;
use crate::diagnose::outcome::*;
use crate::diagnose::quantify::held_out::shrinkage;
use crate::diagnose::quantify::next_input::next_input;
use crate::diagnose::quantify::power::power;
use crate::diagnose::settings::DiagnoseSettings;
use crate::diagnose::summary::{fitted_parameters, reported};
use crate::diagnose::test::fitted_twin::FittedTwin;
use crate::diagnose::test::free_run::{Runner, free_runs};
use crate::diagnose::thresholds::Thresholds;
use crate::likelihood::ensemble::dithered;
use crate::likelihood::ensemble::measured;
use crate::math::six_digits;
use crate::progress::Progress;
use crate::record::Record;
use crate::setting::SettingError;
use crate::study::Study;
use crate::twin::Noise;
use std::time::Instant;

/// Diagnoses the gap between a twin and records of one real system.
///
/// All records share θ, but for unknown starts. A validation record is used for the test, the order of explanations, and
/// the share closed. A twin without equations is looked at through ensembles of its simulations instead of a filter; only effects of its
/// signals can then be named. The same seed gives the same bits on any number of threads.
///
/// ```
/// use truetwin::diagnose::{DiagnoseSettings, Verdict, diagnose};
/// use truetwin::progress::Progress;
/// use truetwin::study::{RecordPlan, Study};
/// use truetwin::effect::*;
/// use truetwin::record::*;
/// use truetwin::twin::*;
/// use truetwin::twins::VanDerPol;
///
/// let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 300))?;
/// let drive = Drive::autonomous(0.05, 300)?;
/// let outputs = VanDerPol.simulate(&[1.5], &drive, Noise::new(1, "doc", 0))?;
/// let record = Record::new(drive, outputs)?;
/// let found = diagnose(&study, &[record], None, &DiagnoseSettings::default(), &Progress::silent())?;
/// assert_eq!(found.verdict, Verdict::NoGap);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// [`DiagnoseError`]: records that do not fit the twin or each other, settings that cannot be used, a twin that
/// no start fits, and cancellation.
pub fn diagnose(
    study: &Study,
    records: &[Record],
    validation: Option<&Record>,
    settings: &DiagnoseSettings,
    progress: &Progress,
) -> Result<Diagnosis, DiagnoseError> {
    let clock = Instant::now();
    check(study, records, validation, settings)?;
    let noise = Noise::new(settings.seed, "diagnose", 0);
    let twin = measured(study.twin(), records)?;
    let dithered = match twin.1 {
        true => Some(dithered(records, noise)?),
        false => None,
    };
    let records = dithered.as_deref().unwrap_or(records);
    let validation: Option<Vec<Record>> = validation.map(|v| vec![v.clone()]);
    let validation = validation.as_deref();
    let together = validation.map(|v| [records, v].concat());
    let context = Context::new(study, &twin, records, validation, together.as_deref());
    let mut detected = detect(&context, records, settings, noise, progress)?;
    let Attributed {
        answer,
        step,
        after,
        effects,
        found,
    } = match settings.detection_only {
        true => Attributed::nothing(),
        false => attribute(&context, &mut detected, settings, noise, progress)?,
    };
    let Detected { bench, nulls, .. } = &detected;
    let structural = detected.verdict == Verdict::StructuralGap;
    let (mut place, mut discovery, mut next) = Default::default();
    let (mut visible, mut shrunk) = (vec![], None);
    if !settings.detection_only {
        if let Some(found) = found.as_deref().filter(|_| structural) {
            let alpha = settings.alpha;
            (place, discovery) =
                locate(&context, &detected, found, &answer, alpha, noise, progress)?;
            place.after = after;
            if answer.decision == Decision::Class {
                let stage = progress.stage("next input", 1);
                next = next_input(bench, found, &answer.class, noise.child("next"))?;
                stage.tick()?;
            }
        }
        let stage = progress.stage("how far", 2);
        visible = power(bench, nulls, settings.alpha)?;
        stage.tick()?;
        let found = found.as_deref();
        shrunk = shrinkage(
            &context,
            bench,
            step.as_ref(),
            &answer,
            found,
            settings,
            noise,
        )?;
        stage.tick()?;
    }
    let last = step.as_ref().map_or(bench, |step| &step.bench);
    let space = context.twin.parameters();
    let (parameters, nuisance) =
        fitted_parameters(&space.iter().collect::<Vec<_>>(), last, settings);
    let runs = |record: &Record| beside(&context, bench, last, &answer, record);
    Ok(Diagnosis {
        twin: study.name().into(),
        verdict: detected.verdict,
        parameters,
        nuisance,
        place,
        which: Which {
            decision: answer.decision,
            effects,
            accepted: answer.accepted.iter().map(Accepted::key).collect(),
            unexplained_p_value: answer.unexplained,
            next_input: next,
            class: answer.class.clone(),
            catch_all: answer.catch_all.clone(),
        },
        shrinkage: shrunk,
        discovery,
        power: visible,
        free_runs: runs(&records[0])?,
        validation_runs: validation.map(|v| runs(&v[0])).transpose()?,
        candidates: bench.dictionary.candidates.len(),
        detection: detected.detection,
        not_tested: detected.not_tested,
        seconds: clock.elapsed().as_secs_f64(),
    })
}

/// Which effect, as far as the verdict asks for one.
struct Attributed<'a> {
    answer: Answer,
    step: Option<Step<'a>>,
    /// Maps with what was accepted, or else came nearest, added.
    after: Option<Maps>,
    effects: Vec<EffectFit>,
    found: Option<Vec<Explanation>>,
}

impl Attributed<'_> {
    fn nothing() -> Self {
        Self {
            answer: Answer {
                decision: Decision::NotNeeded,
                accepted: vec![],
                class: vec![],
                unexplained: None,
                catch_all: None,
            },
            step: None,
            after: None,
            effects: vec![],
            found: None,
        }
    }
}

fn attribute<'a>(
    context: &Context<'a>,
    detected: &mut Detected<'a>,
    settings: &DiagnoseSettings,
    noise: Noise,
    progress: &Progress,
) -> Result<Attributed<'a>, DiagnoseError> {
    let (found, within) = (detected.found.take(), detected.within.take());
    let Detected {
        bench, nulls, test, ..
    } = &*detected;
    let mut all = Attributed {
        found,
        ..Attributed::nothing()
    };
    match (detected.verdict, within) {
        (Verdict::StructuralGap, _) => {
            let list = match all.found.take() {
                Some(list) => list,
                None => explained(context, bench, nulls, progress)?,
            };
            let stage = progress.stage("accept", 2 * settings.unexplained);
            let decided = decide(context, bench, &list, settings, noise, &stage)?;
            stage.finish();
            let added = decided.step.as_ref().or(decided.best.as_ref());
            if let (Some(added), Some(left)) = (added, &decided.left) {
                all.after = Some(maps(&added.bench, &left.test, None)?);
            }
            (all.answer, all.step) = (decided.answer, decided.step);
            all.effects = reported(bench, &list, test, &all.answer);
            all.found = Some(list);
        }
        (Verdict::ParameterGap, Some(within)) => {
            let stage = progress.stage("explain", bench.dictionary.candidates.len());
            let list = absorbing(bench, &nulls.own, within, &stage)?;
            stage.finish();
            if !list.is_empty() {
                all.answer.decision = Decision::Absorbed;
                all.answer.class = (list.iter())
                    .map(|e| bench.dictionary.candidates[e.candidate].key())
                    .collect();
            }
            all.effects = reported(bench, &list, test, &all.answer);
        }
        _ => {}
    }
    Ok(all)
}

/// Free runs beside a record: of the twin, and with the accepted effects.
fn beside(
    context: &Context<'_>,
    bench: &FittedTwin<'_>,
    last: &FittedTwin<'_>,
    answer: &Answer,
    record: &Record,
) -> Result<FreeRuns, DiagnoseError> {
    let runner = |bench: &FittedTwin<'_>, additions: &[Addition]| {
        let theta = bench.problem.of_record(0, &bench.fitted.theta);
        Runner::new(context.twin, additions, theta)
    };
    let additions: Vec<Addition> = answer.accepted.iter().map(|a| a.addition.clone()).collect();
    let grown = match additions.is_empty() {
        true => None,
        false => Some(runner(last, &additions)?),
    };
    Ok(free_runs(record, &runner(bench, &[])?, grown.as_ref()))
}

pub(in crate::diagnose) fn check(
    study: &Study,
    records: &[Record],
    validation: Option<&Record>,
    settings: &DiagnoseSettings,
) -> Result<(), DiagnoseError> {
    let first = records.first().ok_or(DiagnoseError::NoRecord)?;
    let expected = first.drive().dt();
    let measured =
        (records.iter().enumerate()).map(|(i, record)| (GivenRecord::Measured(i), record));
    let validation = validation.map(|record| (GivenRecord::Validation, record));
    for (which, record) in measured.chain(validation) {
        (record.check_channels(&study.twin().signals())).map_err(|error| {
            DiagnoseError::Channels {
                record: which,
                error,
            }
        })?;
        let given = record.drive().dt();
        if (given - expected).abs() > 1e-3 * expected {
            return Err(DiagnoseError::Steps {
                record: which,
                given: six_digits(given),
                expected: six_digits(expected),
            });
        }
        if record.samples() < Thresholds::LEAST_SAMPLES {
            return Err(DiagnoseError::TooShort {
                record: which,
                samples: record.samples(),
                least: Thresholds::LEAST_SAMPLES,
            });
        }
    }
    let (alpha, replicates) = (settings.alpha, settings.replicates as f64);
    SettingError::unless(
        alpha > 0.0 && alpha < 1.0,
        "alpha",
        alpha,
        "choose a level between 0 and 1, such as 0.05",
    )?;
    SettingError::unless(
        (replicates + 1.0) * alpha > 1.0,
        "replicates",
        replicates,
        "take more than 1/alpha",
    )?;
    SettingError::unless(
        settings.unexplained >= 50,
        "unexplained",
        settings.unexplained,
        "take at least 50",
    )?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Drive, Signal};
    use crate::study::RecordPlan;
    use crate::twins::VanDerPol;

    /// An oscillator with a cubic spring, its step given in milliseconds where seconds are expected: an answer or an error,
    /// never a panic.
    #[test]
    fn a_record_in_milliseconds_does_not_panic() {
        let (mut x, mut v) = (1.0f64, 0.0f64);
        let outputs = Signal::from_shape_fn((200, 1), |_| {
            for _ in 0..50 {
                v += 1e-3 * (1.5 * (1.0 - x * x) * v - x - 0.028 * x.powi(3));
                x += 1e-3 * v;
            }
            x
        });
        let record = Record::new(Drive::autonomous(50.0, 200).unwrap(), outputs).unwrap();
        let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 200)).unwrap();
        let settings = DiagnoseSettings::default();
        let answer = diagnose(&study, &[record], None, &settings, &Progress::silent());
        assert!(
            matches!(answer, Err(DiagnoseError::NoSimulation)),
            "{answer:?}"
        );
    }
}
