//! Units of time, steps, sampling, length.

use super::limits::LIMITS;
use super::size::conversion;
use super::{or_pass, text};
use crate::fit::Warning;
use crate::record::{Drive, Record, RecordError};
use crate::study::Study;
use crate::twin::conformance::Finding;

/// Units that times are written in by mistake, and how many of them a second is.
const UNITS: [(f64, &str); 6] = [
    (1e3, "milliseconds"),
    (1e6, "microseconds"),
    (1e9, "nanoseconds"),
    (1.0 / 60.0, "minutes"),
    (1.0 / 3600.0, "hours"),
    (1.0 / 86_400.0, "days"),
];

/// Returns the unit that times are in by mistake, so many of which are a second, with what shows it; `constants` gives the fastest and the
/// slowest time constant of the twin, where it can be told.
pub(super) fn mistaken_unit(
    study: &Study,
    drive: &Drive,
    constants: impl FnOnce() -> Option<(f64, f64)>,
) -> Option<(f64, String)> {
    let step = drive.dt();
    let plan = study.plan()?.step;
    let like_plan = |unit: f64, near: f64| (step / unit / plan).ln().abs() <= near.ln();
    let is_like = |near| UNITS.iter().any(|(unit, _)| like_plan(*unit, near));
    if drive.rows().has_stamps() || !is_like(LIMITS.near_plan) {
        return None;
    }
    let length = drive.time(drive.samples() - 1);
    let near = match constants() {
        Some((fast, slow)) if step <= 0.5 * fast && length >= slow => return None,
        Some(_) => LIMITS.near_plan,
        None => LIMITS.as_planned,
    };
    let mut units = UNITS.into_iter();
    let (unit, name) = units.find(|(unit, _)| like_plan(*unit, near))?;
    let shown = format!(
        "a step of {} s, {} s in the study: t seems to be in {name}",
        text(step),
        text(plan)
    );
    Some((unit, shown))
}

/// Checks the time grid; also returns how many units of the record's time a second is.
pub(super) fn check(
    study: &Study,
    record: &Record,
    constants: Option<(f64, f64)>,
) -> (Vec<Finding>, f64) {
    let drive = record.drive();
    if let Some((unit, shown)) = mistaken_unit(study, drive, || constants) {
        let message = format!("{shown}; {}", conversion(unit));
        return (vec![Finding::warning("time", message)], unit);
    }
    let step = drive.dt();
    let plan = study.plan().map_or(step, |plan| plan.step);
    let length = drive.time(record.samples() - 1);
    let mut findings = vec![];
    let mut warn = |check, message| findings.push(Finding::warning(check, message));
    if drive.steps_vary() {
        let message = format!(
            "the steps vary; a fit takes them for a twin with equations, and so does a diagnosis where their median is the study's step; otherwise resample the record to {} s",
            text(step)
        );
        warn("step", message);
    } else if (step / plan - 1.0).abs() > LIMITS.same {
        let message = format!(
            "{} s, {} s in the study: a fit takes any step; for a diagnosis or an estimate resample the record, change the step of the study, or let the twin step as the record does",
            text(step),
            text(plan)
        );
        warn("step", message);
    }
    let mut pass = "the study's step".to_owned();
    if let Some((fast, slow)) = constants {
        pass += &format!(
            "; time constants of the twin: {} to {} s",
            text(fast),
            text(slow)
        );
        if step > 0.5 * fast {
            let message = format!(
                "a step of {} s is longer than half the twin's fastest time constant, {} s: fast motion is lost; record with a step of {} s or less",
                text(step),
                text(fast),
                text(0.5 * fast)
            );
            warn("sampling", message);
        }
        if length < slow {
            let message = format!(
                "{} s, shorter than the twin's slowest time constant, {slow} s: slow motion cannot be told; record for {slow} s or more",
                text(length),
                slow = text(slow)
            );
            warn("length", message);
        }
    }
    (or_pass(findings, "time", &pass), 1.0)
}

/// Warns of events at times that the record has not.
pub(super) fn events(study: &Study, record: &Record) -> Vec<Finding> {
    let theta = study.twin.parameters().centre();
    let outside = Warning::events_outside(&study.twin, &theta, std::slice::from_ref(record));
    (outside.iter())
        .map(|doubt| Finding::warning("time", format!("{}; {}", doubt.what, doubt.remedy)))
        .collect()
}

/// The record with its times in seconds.
pub(super) fn in_seconds(record: Record, unit: f64) -> Result<Record, RecordError> {
    if unit == 1.0 {
        return Ok(record);
    }
    let drive = record.drive();
    let times: Vec<f64> = (0..record.samples())
        .map(|k| drive.own_time(k) / unit)
        .collect();
    let rows = drive.rows().clone();
    let drive = Drive::with_times(&times, drive.inputs().clone())?.read_from(rows);
    Record::new(drive, record.outputs().clone())
}
