//! Entry of a diagnosis, and the order of its steps.

use crate::diagnose::context::Context;
use crate::diagnose::detect::{Detected, detect, explained};
use crate::diagnose::error::{DiagnoseError, GivenRecord};
use crate::diagnose::explain::attribute::Explanation;
use crate::diagnose::explain::decide::{Conclusion, decide};
use crate::diagnose::explain::extended::{Accepted, ExtendedTwin, additions};
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
/// the share closed. The likelihood of a twin without equations is an ensemble's instead of a filter's; only effects of its
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
/// let diagnosis = diagnose(&study, &[record], None, &DiagnoseSettings::default(), &Progress::silent())?;
/// assert_eq!(diagnosis.verdict, Verdict::NoGap);
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
    let dithered = if twin.1 {
        Some(dithered(records, noise)?)
    } else {
        None
    };
    let records = dithered.as_deref().unwrap_or(records);
    let validation: Option<Vec<Record>> = validation.map(|v| vec![v.clone()]);
    let validation = validation.as_deref();
    let together = validation.map(|v| [records, v].concat());
    let context = Context::new(study, &twin, records, validation, together.as_deref());
    let mut detected = detect(&context, records, settings, noise, progress)?;
    let Attributed {
        conclusion,
        extended,
        after,
        effects,
        explanations,
    } = if settings.detection_only {
        Attributed::nothing()
    } else {
        attribute(&context, &mut detected, settings, noise, progress)?
    };
    let Detected { model, null, .. } = &detected;
    let structural = detected.verdict == Verdict::StructuralGap;
    let (mut location, mut discovery, mut next) = Default::default();
    let (mut visible, mut shrunk) = (vec![], None);
    if !settings.detection_only {
        if let Some(explanations) = explanations.as_deref().filter(|_| structural) {
            let alpha = settings.alpha;
            (location, discovery) = locate(
                &context,
                &detected,
                explanations,
                &conclusion,
                alpha,
                noise,
                progress,
            )?;
            location.after = after;
            if conclusion.decision == Decision::Class {
                let stage = progress.stage("next input", 1);
                next = next_input(model, explanations, &conclusion.class, noise.child("next"))?;
                stage.tick()?;
            }
        }
        let stage = progress.stage("how far", 2);
        visible = power(model, null, settings.alpha)?;
        stage.tick()?;
        let explanations = explanations.as_deref();
        shrunk = shrinkage(
            &context,
            model,
            extended.as_ref(),
            &conclusion,
            explanations,
            settings,
            noise,
        )?;
        stage.tick()?;
    }
    let last = extended.as_ref().map_or(model, |extended| &extended.model);
    let space = context.twin.parameters();
    let (parameters, nuisance) =
        fitted_parameters(&space.iter().collect::<Vec<_>>(), last, settings);
    let runs = |record: &Record| beside(&context, model, last, &conclusion, record);
    Ok(Diagnosis {
        twin: study.name().into(),
        verdict: detected.verdict,
        parameters,
        nuisance,
        location,
        cause: Cause {
            decision: conclusion.decision,
            effects,
            accepted: conclusion.accepted.iter().map(Accepted::key).collect(),
            unexplained_p_value: conclusion.unexplained,
            next_input: next,
            class: conclusion.class.clone(),
            catch_all: conclusion.catch_all.clone(),
        },
        shrinkage: shrunk,
        discovery,
        power: visible,
        free_runs: runs(&records[0])?,
        validation_runs: validation.map(|v| runs(&v[0])).transpose()?,
        candidates: model.dictionary.candidates.len(),
        detection: detected.detection,
        not_tested: detected.not_tested,
        seconds: clock.elapsed().as_secs_f64(),
    })
}

/// Attribution, as far as the verdict asks for one.
struct Attributed<'a> {
    conclusion: Conclusion,
    extended: Option<ExtendedTwin<'a>>,
    /// Maps with what was accepted, or else came nearest, added.
    after: Option<Maps>,
    effects: Vec<EffectFit>,
    explanations: Option<Vec<Explanation>>,
}

impl Attributed<'_> {
    fn nothing() -> Self {
        Self {
            conclusion: Conclusion {
                decision: Decision::NotNeeded,
                accepted: vec![],
                class: vec![],
                unexplained: None,
                catch_all: None,
            },
            extended: None,
            after: None,
            effects: vec![],
            explanations: None,
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
    let (explanations, within) = (detected.explanations.take(), detected.within.take());
    let Detected {
        model, null, test, ..
    } = &*detected;
    let mut all = Attributed {
        explanations,
        ..Attributed::nothing()
    };
    match (detected.verdict, within) {
        (Verdict::StructuralGap, _) => {
            let list = match all.explanations.take() {
                Some(list) => list,
                None => explained(context, model, null, progress)?,
            };
            let stage = progress.stage("accept", 2 * settings.unexplained);
            let decided = decide(context, model, &list, settings, noise, &stage)?;
            stage.finish();
            let added = decided.extended.as_ref().or(decided.best.as_ref());
            if let (Some(added), Some(left)) = (added, &decided.left) {
                all.after = Some(maps(&added.model, &left.test, None)?);
            }
            (all.conclusion, all.extended) = (decided.conclusion, decided.extended);
            all.effects = reported(model, &list, test, &all.conclusion);
            all.explanations = Some(list);
        }
        (Verdict::ParameterGap, Some(within)) => {
            let stage = progress.stage("explain", model.dictionary.candidates.len());
            let list = absorbing(model, &null.own, within, &stage)?;
            stage.finish();
            if !list.is_empty() {
                all.conclusion.decision = Decision::Absorbed;
                all.conclusion.class = (list.iter()).map(|e| model.candidate(e).key()).collect();
            }
            all.effects = reported(model, &list, test, &all.conclusion);
        }
        _ => {}
    }
    Ok(all)
}

/// Free runs beside a record: of the twin, and with the accepted effects.
fn beside(
    context: &Context<'_>,
    model: &FittedTwin<'_>,
    last: &FittedTwin<'_>,
    conclusion: &Conclusion,
    record: &Record,
) -> Result<FreeRuns, DiagnoseError> {
    let runner = |model: &FittedTwin<'_>, additions: &[Addition]| {
        let theta = model.theta();
        Runner::new(context.twin, additions, theta)
    };
    let additions = additions(&conclusion.accepted);
    let grown = if additions.is_empty() {
        None
    } else {
        Some(runner(last, &additions)?)
    };
    Ok(free_runs(record, &runner(model, &[])?, grown.as_ref()))
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
        (record.check_channels(&study.twin().signals()))
            .and_then(|()| study.twin().check_drive(record.drive()))
            .map_err(|error| DiagnoseError::Channels {
                record: which,
                error,
            })?;
        let given = record.drive().dt();
        let uniform = first.drive().is_uniform() && record.drive().is_uniform();
        if uniform && (given - expected).abs() > 1e-3 * expected {
            return Err(DiagnoseError::Steps {
                record: which,
                given: six_digits(given),
                expected: six_digits(expected),
            });
        }
        let samples = record.measured_rows();
        if samples < Thresholds::LEAST_SAMPLES {
            return Err(DiagnoseError::TooShort {
                record: which,
                samples,
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
    use crate::record::{Drive, Signal, Signals};
    use crate::study::RecordPlan;
    use crate::twin::{DigitalTwin, ParameterSpace, SimulationError};
    use crate::twins::VanDerPol;

    /// An oscillator with a cubic spring, its extended given in milliseconds where seconds are expected: an conclusion or an error,
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
        let conclusion = diagnose(&study, &[record], None, &settings, &Progress::silent());
        assert!(
            matches!(conclusion, Err(DiagnoseError::NoSimulation)),
            "{conclusion:?}"
        );
    }

    /// Records with missing outputs and varying steps are diagnosed as others are: of the twin itself no gap, of a sensor
    /// that is off one.
    #[test]
    fn records_come_with_gaps_and_varying_steps() {
        let mut source = Noise::new(5, "gaps", 0).source("cells");
        let mut times = vec![0.0];
        for k in 1..400 {
            times.push(times[k - 1] + 0.05 * (0.5 + source.uniform()));
        }
        let drive = Drive::with_times(&times, Signal::zeros((400, 0))).unwrap();
        let clean = VanDerPol
            .simulate(&[1.5], &drive, Noise::new(1, "gaps", 0))
            .unwrap();
        let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 400)).unwrap();
        let mut verdict = |bend: &dyn Fn(f64) -> f64| {
            let outputs = clean.mapv(|y| match source.uniform() < 0.15 {
                true => f64::NAN,
                false => bend(y),
            });
            let record = Record::new(drive.clone(), outputs).unwrap();
            let settings = DiagnoseSettings::default();
            let found = diagnose(&study, &[record], None, &settings, &Progress::silent()).unwrap();
            assert!(found.detection.p_value > 0.0, "{:?}", found.detection);
            let shrinkage = found.shrinkage.unwrap();
            assert!(shrinkage.before.is_finite() && shrinkage.before > 0.0);
            found.verdict
        };
        assert_eq!(verdict(&|y| y), Verdict::NoGap);
        assert_ne!(verdict(&|y| y + 0.6 * y * y), Verdict::NoGap);
    }

    /// A black box is simulated with one step.
    #[test]
    fn a_black_box_needs_one_step() {
        struct Boxed;
        impl DigitalTwin for Boxed {
            fn parameters(&self) -> ParameterSpace {
                DigitalTwin::parameters(&VanDerPol)
            }
            fn signals(&self) -> Signals {
                DigitalTwin::signals(&VanDerPol)
            }
            fn simulate(
                &self,
                theta: &[f64],
                drive: &Drive,
                noise: Noise,
            ) -> Result<Signal, SimulationError> {
                DigitalTwin::simulate(&VanDerPol, theta, drive, noise)
            }
        }
        let times: Vec<f64> = (0..200).map(|k| f64::from(k * k)).collect();
        let drive = Drive::with_times(&times, Signal::zeros((200, 0))).unwrap();
        let record = Record::new(drive, Signal::ones((200, 1))).unwrap();
        let study = Study::new("boxed", Boxed, RecordPlan::autonomous(0.05, 200)).unwrap();
        let settings = DiagnoseSettings::default();
        let error = diagnose(&study, &[record], None, &settings, &Progress::silent());
        let message = error.unwrap_err().to_string();
        assert!(message.contains("record 1 does not fit the twin: column t: the steps vary"));
        assert!(
            message.ends_with("resample the record to one step"),
            "{message}"
        );
    }
}
