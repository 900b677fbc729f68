//! Entry of a diagnosis.

use super::outcome::Diagnosis;
use super::report::Report;
use super::search::{Search, Setup, Watch, searched};
use super::settings::DiagnoseSettings;
use super::thresholds::THRESHOLDS;
use crate::fit::Warning;
use crate::fit::doubts::STILL_OUTPUT;
use crate::likelihood::{start_elsewhere, with_better_start};
use crate::math::six_digits;
use crate::progress::Progress;
use crate::record::Record;
use crate::setting::SettingError;
use crate::study::{Study, StudyError};
use std::time::Instant;

/// Diagnoses the gap between a twin and records of one real system.
///
/// All records share θ, noise levels and effects; their starts may differ. A validation record is used for the share closed alone. Noise
/// levels are fitted with θ unless the study says that they are known, and the first state is uncertain unless it is declared. The
/// likelihood of a twin without equations is an ensemble's instead of a filter's; only effects of its signals can then be named. The same
/// seed gives the same bits on any number of threads.
///
/// ```
/// use truetwin::diagnose::Verdict;
/// use truetwin::prelude::*;
/// use truetwin::twins::VanDerPol;
///
/// let drive = Drive::autonomous(0.05, 300)?;
/// let outputs = VanDerPol.simulate(&[1.5], &drive, Noise::new(1, "doc", 0))?;
/// let record = Record::new(drive, outputs)?;
/// let settings = DiagnoseSettings { seed: 7, ..DiagnoseSettings::default() };
/// let study = Study::of(VanDerPol)?;
/// let diagnosis = diagnose(&study, &[record], None, &settings, &Progress::silent())?;
/// assert_eq!(diagnosis.verdict, Verdict::NoGap);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// [`StudyError`]: records that do not fit the twin or each other, settings that cannot be used, a twin that
/// no start fits, and cancellation.
pub fn diagnose(
    study: &Study,
    records: &[Record],
    validation: Option<&Record>,
    settings: &DiagnoseSettings,
    progress: &Progress,
) -> Result<Diagnosis, StudyError> {
    let whole = || whole(study, records, validation, settings, progress);
    (study.twin())
        .side_by_side(whole)
        .map_err(|error| match error {
            StudyError::NoFit { .. } => study.no_fit(records),
            other => other,
        })
}

fn whole(
    study: &Study,
    records: &[Record],
    validation: Option<&Record>,
    settings: &DiagnoseSettings,
    progress: &Progress,
) -> Result<Diagnosis, StudyError> {
    let clock = Instant::now();
    let study = &*study.for_records(records)?;
    check(study, records, validation, settings)?;
    let watch = Watch { settings, progress };
    let trusting = study.trusting_starts();
    let mut found = searched(study, records, watch)?;
    let mut held = None;
    if contradicts_start(study, &found, records, settings) {
        match searched(&trusting, records, watch) {
            Err(StudyError::Cancelled(_)) if settings.give_partial => found.is_partial = true,
            other => held = Some(other?),
        }
    }
    let log_z = |found: &Search<Setup<'_>>| Some(found.known.listed_log_z());
    let (found, is_held) = match held {
        Some(held) => {
            let found = (found, study.bends_readings());
            with_better_start(found, log_z, || Ok::<_, StudyError>(held))?
        }
        None => (found, false),
    };
    let study = if is_held { &trusting } else { study };
    let diagnosis = reported(study, found, validation, watch)?;
    Ok(Diagnosis {
        seconds: clock.elapsed().as_secs_f64(),
        ..diagnosis
    })
}

/// The report of a search. Where the search or its report is stopped, what was found is reported as for a quick look, without a share, which
/// takes longest.
fn reported(
    study: &Study,
    mut found: Search<Setup<'_>>,
    validation: Option<&Record>,
    watch: Watch<'_>,
) -> Result<Diagnosis, StudyError> {
    fn report<'d>(
        study: &'d Study,
        found: &'d Search<Setup<'d>>,
        validation: Option<&'d Record>,
        watch: Watch<'d>,
    ) -> Report<'d> {
        Report {
            study,
            found,
            validation: validation.map(std::slice::from_ref),
            watch,
        }
    }
    let Watch { settings, progress } = watch;
    let hurried = DiagnoseSettings {
        quick: true,
        calibrate: 0,
        ..settings.clone()
    };
    let is_stopped = found.is_partial;
    let used = Watch {
        settings: if is_stopped { &hurried } else { settings },
        progress,
    };
    let (detection, is_cut) = report(study, &found, validation, used).detection()?;
    if !is_stopped && !is_cut {
        match report(study, &found, validation, watch).diagnosis(detection) {
            Err(StudyError::Cancelled(_)) if settings.give_partial => {}
            whole => return whole,
        }
    }
    found.is_partial = true;
    found.evidence.base.model.problem.passes().go_on();
    let settings = &hurried;
    report(study, &found, validation, Watch { settings, progress }).diagnosis(detection)
}

/// Returns whether a first row is not what the twin's code says, and something is missing, or the study has effects that may bend it.
fn contradicts_start(
    study: &Study,
    found: &Search<Setup<'_>>,
    records: &[Record],
    settings: &DiagnoseSettings,
) -> bool {
    let is_explained = found.known.log_z() - found.known.twin().log_z <= THRESHOLDS.gap;
    let elsewhere = || start_elsewhere(study.twin(), records, &settings.beliefs(study));
    let may_stand = !is_explained || study.bends_readings();
    !found.is_partial && may_stand && elsewhere().is_some_and(|start| !start.is_held)
}

impl Study {
    /// Diagnoses the gap between the twin and records of one system, as [`diagnose`] does with its default settings.
    ///
    /// # Errors
    ///
    /// As [`diagnose`].
    pub fn diagnose(&self, records: &[Record]) -> Result<Diagnosis, StudyError> {
        let settings = DiagnoseSettings::default();
        diagnose(self, records, None, &settings, &Progress::silent())
    }
}

/// Checks records and settings.
fn check(
    study: &Study,
    records: &[Record],
    validation: Option<&Record>,
    settings: &DiagnoseSettings,
) -> Result<(), StudyError> {
    let first = records.first().ok_or(StudyError::NoRecord)?;
    let expected = first.drive().dt();
    let measured = (records.iter().enumerate()).map(|(i, record)| (Some(i), record));
    let held_out = validation.map(|record| (None, record));
    for (which, record) in measured.chain(held_out) {
        study.check_one_of(which, record)?;
        let given = record.drive().dt();
        let uniform = first.drive().is_uniform() && record.drive().is_uniform();
        if uniform && (given - expected).abs() > 1e-3 * expected {
            return Err(StudyError::Steps {
                record: which,
                given: six_digits(given),
                expected: six_digits(expected),
            });
        }
        let samples = record.measured_rows();
        let least = study.twin().parameters().len() + 3;
        if samples < least {
            return Err(StudyError::TooShort {
                record: which,
                samples,
                least,
            });
        }
    }
    let signals = study.twin().signals();
    Record::check_outputs(records, &signals.outputs)?;
    let validation = validation.map_or(&[][..], std::slice::from_ref);
    for (of, records) in [("records", records), ("validation record", validation)] {
        let still = Warning::still(&signals, records).into_iter();
        if still.filter(|told| told.code == STILL_OUTPUT).count() == signals.outputs.len() {
            return Err(StudyError::Still(of));
        }
    }
    SettingError::unless_level("alpha", settings.alpha, 0.05)?;
    SettingError::unless_at_most("calibrate", settings.calibrate, MOST_SIMULATIONS)?;
    Ok(())
}

/// Most simulations of a calibration.
const MOST_SIMULATIONS: usize = 100_000;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::Verdict;
    use crate::diagnose::fixture::{biased_record, only, tanks};
    use crate::progress::Listener;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};

    /// Stops the work once so many units of a stage are done.
    struct Impatient {
        stage: &'static str,
        units: u64,
        asked: AtomicBool,
    }

    impl Impatient {
        fn progress(stage: &'static str, units: u64) -> Progress {
            let asked = AtomicBool::default();
            Progress::new(Arc::new(Self {
                stage,
                units,
                asked,
            }))
        }
    }

    impl Listener for Impatient {
        fn advanced(&self, stage: &str, done: u64, _: u64) {
            let is_enough = stage == self.stage && done >= self.units;
            self.asked.fetch_or(is_enough, Ordering::Relaxed);
        }
        fn cancelled(&self) -> bool {
            self.asked.load(Ordering::Relaxed)
        }
    }

    /// A calibration that is stopped counts the records that it has simulated, and the diagnosis is marked as interrupted.
    #[test]
    fn a_cancelled_calibration_says_so() {
        let study = tanks(60);
        let records = [biased_record(&study, 0.0, 5)];
        let settings = DiagnoseSettings {
            give_partial: true,
            quick: true,
            calibrate: 1000,
            ..DiagnoseSettings::default()
        };
        let progress = Impatient::progress("calibrate", 2);
        let found = diagnose(&study, &records, None, &settings, &progress).unwrap();
        assert!(found.interrupted);
        let done = found.detection.simulations;
        assert!((2..100).contains(&done), "{done}");
        assert_eq!(found.detection.p_value.is_some(), done > 0);
    }

    #[test]
    fn a_cancelled_search_gives_what_was_found() {
        let study = tanks(100);
        let records = [biased_record(&study, 2.0, 5)];
        let found = |give_partial| {
            let settings = DiagnoseSettings {
                give_partial,
                ..only(&study, &["linear-loss", "sensor-bias", "sensor-gain"])
            };
            let progress = Impatient::progress("explain", 3);
            diagnose(&study, &records, None, &settings, &progress)
        };
        let partial = found(true).unwrap();
        assert!(partial.interrupted && partial.quick);
        assert_eq!(partial.verdict, Verdict::StructuralGap);
        assert!(partial.cause.effects.iter().any(|e| e.id == "sensor-bias"));
        assert!(matches!(found(false), Err(StudyError::Cancelled(_))));
    }

    /// A gap of a long record is found in its first rows and fitted to all of them: the magnitude is known as well as all rows let it be.
    #[test]
    fn a_long_record_is_searched_in_part() {
        let study = tanks(4096);
        let settings = DiagnoseSettings {
            quick: true,
            ..only(&study, &["sensor-bias", "sensor-gain"])
        };
        let record = biased_record(&study, 2.0, 5);
        let biased = diagnose(&study, &[record], None, &settings, &Progress::silent()).unwrap();
        assert_eq!(biased.cause.accepted, ["sensor-bias@sensor"]);
        let bias = biased.cause.effects[0].magnitudes[0].1;
        assert!((bias - 2.0).abs() < 0.1, "{bias}");
        assert!(biased.warnings.iter().any(|w| w.code == "first-rows"));
        assert_eq!(biased.residuals[0].samples(), 4096);
    }
}
