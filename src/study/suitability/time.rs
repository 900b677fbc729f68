//! Units of time, steps, sampling, length.

use super::{or_pass, text};
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
/// Largest ratio of a step to the plan's, in the right unit: records are seldom sampled quite as planned, and units differ by 60 or more.
const NEAR_PLAN: f64 = 3.0;
/// The same for a twin without equations, where nothing but the plan tells its pace.
const AS_PLANNED: f64 = 1.2;
/// Share within which steps are the same.
const SAME: f64 = 1e-3;

/// Checks the time grid; also returns how many units of the record's time a second is.
pub(super) fn check(
    study: &Study,
    record: &Record,
    constants: Option<(f64, f64)>,
) -> (Vec<Finding>, f64) {
    let drive = record.drive();
    let step = drive.dt();
    let plan = study.plan().map_or(step, |plan| plan.step);
    let length = drive.time(record.samples() - 1);
    let fits = |unit: f64| match constants {
        Some((fast, slow)) => step / unit <= 0.5 * fast && length / unit >= slow,
        None => false,
    };
    let near = if constants.is_some() {
        NEAR_PLAN
    } else {
        AS_PLANNED
    };
    let like_plan = |unit: f64| (step / unit / plan).ln().abs() <= near.ln();
    if !fits(1.0)
        && let Some((unit, name)) = UNITS.into_iter().find(|(unit, _)| like_plan(*unit))
    {
        let (operation, factor) = match unit > 1.0 {
            true => ("divide", unit),
            false => ("multiply", 1.0 / unit),
        };
        let finding = Finding::warning(
            "time",
            format!(
                "a step of {} s, {} s in the study: t seems to be in {name}; {operation} it by {}",
                text(step),
                text(plan),
                text(factor)
            ),
        );
        return (vec![finding], unit);
    }
    let mut findings = vec![];
    if !drive.is_uniform() {
        let remedy = format!(
            "`fit` takes them for a twin with equations, and so does `diagnose` where their median is the study's step; otherwise: truetwin resample R.csv --step {} --out R2.csv",
            text(step)
        );
        findings.push(Finding::warning(
            "step",
            format!("the steps vary; {remedy}"),
        ));
    } else if (step / plan - 1.0).abs() > SAME {
        let message = format!(
            "{} s, {} s in the study: `fit` takes any step, `diagnose` and `estimate` (features that are scores) with --step-of-record; otherwise: truetwin resample R.csv --step {} --out R2.csv, or [record] step = {} in the study",
            text(step),
            text(plan),
            text(plan),
            text(step)
        );
        findings.push(Finding::warning("step", message));
    }
    if let Some((fast, slow)) = constants {
        if step > 0.5 * fast {
            let message = format!(
                "a step of {} s is longer than half the twin's fastest time constant, {} s: fast motion is lost; record with a step of {} s or less",
                text(step),
                text(fast),
                text(0.5 * fast)
            );
            findings.push(Finding::warning("sampling", message));
        }
        if length < slow {
            let message = format!(
                "{} s, shorter than the twin's slowest time constant, {} s: slow motion cannot be told; record for {} s or more",
                text(length),
                text(slow),
                text(slow)
            );
            findings.push(Finding::warning("length", message));
        }
    }
    let pass = match constants {
        Some((fast, slow)) => format!(
            "the study's step; time constants of the twin: {} to {} s",
            text(fast),
            text(slow)
        ),
        None => "the study's step".into(),
    };
    (or_pass(findings, "time", &pass), 1.0)
}

/// The record with its times in seconds.
pub(super) fn in_seconds(record: &Record, unit: f64) -> Result<Record, RecordError> {
    if unit == 1.0 {
        return Ok(record.clone());
    }
    let drive = record.drive();
    let times: Vec<f64> = (0..record.samples())
        .map(|k| drive.time(k) / unit)
        .collect();
    let drive = Drive::with_times(&times, drive.inputs().clone())?;
    Record::new(drive, record.outputs().clone())
}
