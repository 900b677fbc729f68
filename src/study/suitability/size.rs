//! Inputs outside the plan, and units that are off by a power of ten.

use super::{or_pass, present, text, with_unit};
use crate::math::{deviation, ends, largest, median};
use crate::record::{Drive, Record, RecordError, Signal};
use crate::study::{InputPlan, Study};
use crate::twin::conformance::Finding;

/// Share of the planned range that an input may leave it by: the accuracy of an actuator.
const MARGIN: f64 = 0.05;
/// Powers of ten that a unit may be off by: mega to micro, in one.
const POWERS: i32 = 6;
/// Share of the largest planned input that the largest one of a record reaches in the right unit.
const REACHED: (f64, f64) = (0.3, 1.05);
/// Times that an output is larger or smaller than in any run of the twin before its unit is doubted. In 30 simulated records of two tanks
/// outputs left the range of the runs by 1.12 at most.
const DOUBTED: f64 = 2.5;
/// The same where no power of ten explains it.
const UNLIKE: f64 = 6.0;
/// Times that the deviation of an output in the right unit may leave the range of the runs by.
const USUAL: f64 = 2.0;

/// Side of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Inputs,
    Outputs,
}

/// Checks inputs against the plan; also returns the power of ten that each is too large by.
pub(super) fn check_inputs(
    study: &Study,
    record: &Record,
    planned: Option<&Drive>,
) -> (Vec<Finding>, Vec<f64>) {
    let inputs = study.twin().signals().inputs;
    let (mut findings, mut factors) = (vec![], vec![1.0; inputs.len()]);
    let Some(planned) = planned else {
        return (findings, factors);
    };
    for (j, input) in inputs.iter().enumerate() {
        let (low, high) = match study.plan().and_then(|plan| plan.input.as_ref()) {
            Some(InputPlan::Levels(levels)) => (levels.levels.low(), levels.levels.high()),
            _ => ends(&present(planned.inputs(), j).1),
        };
        let (_, values) = present(record.drive().inputs(), j);
        let (least, most) = ends(&values);
        let unit = |value| with_unit(value, &input.unit);
        let given = format!(
            "input {} lies in {} to {}",
            input.name,
            text(least),
            unit(most)
        );
        let plan = format!("the study's in {} to {}", text(low), unit(high));
        let reach = largest(&values) / low.abs().max(high.abs());
        let in_reach = |factor: f64| (REACHED.0..=REACHED.1).contains(&(reach / factor));
        let is_doubted = !(REACHED.0 / DOUBTED..=DOUBTED).contains(&reach);
        if is_doubted && let Some(factor) = powers().find(|f| in_reach(*f)) {
            findings.push(Finding::warning(
                "scale",
                format!(
                    "{given}, {plan}; {} if the unit differs",
                    conversion(factor)
                ),
            ));
            factors[j] = factor;
            continue;
        }
        let margin = MARGIN * (high - low);
        let outside = (values.iter())
            .filter(|v| **v < low - margin || **v > high + margin)
            .count();
        if outside > 0 {
            findings.push(Finding::warning(
                "inputs",
                format!(
                    "{given}, {plan}: {outside} of {} rows are outside; an estimator has not seen such inputs: widen [record] input in a study file and pretrain again",
                    values.len()
                ),
            ));
        }
    }
    if !inputs.is_empty() {
        findings = or_pass(findings, "inputs", "within the study's range");
    }
    (findings, factors)
}

/// Checks the size of outputs against runs of the twin; also returns the power of ten that each is too large by.
pub(super) fn check_outputs(
    study: &Study,
    record: &Record,
    runs: &[Signal],
) -> (Vec<Finding>, Vec<f64>) {
    let outputs = study.twin().signals().outputs;
    let (mut findings, mut factors) = (vec![], vec![1.0; outputs.len()]);
    for (j, output) in outputs.iter().enumerate() {
        let own = deviation(&present(record.outputs(), j).1);
        let sizes: Vec<f64> = runs
            .iter()
            .map(|run| deviation(&run.column(j).to_vec()))
            .collect();
        let (low, high) = ends(&sizes);
        let Ok(middle) = median(&sizes) else {
            continue;
        };
        if own == 0.0 || low == 0.0 {
            continue;
        }
        let beyond = |size: f64, times: f64| size > times * high || size < low / times;
        if !beyond(own, DOUBTED) {
            continue;
        }
        let nearest = powers()
            .filter(|factor| !beyond(own / factor, USUAL))
            .min_by(|a, b| {
                let off = |factor: f64| (own / factor / middle).ln().abs();
                off(*a).total_cmp(&off(*b))
            });
        let unit = |value| with_unit(value, &output.unit);
        let given = format!(
            "output {} varies by {} rms, runs of the twin by {} to {}",
            output.name,
            unit(own),
            text(low),
            unit(high)
        );
        if let Some(factor) = nearest {
            findings.push(Finding::warning(
                "scale",
                format!(
                    "{given}; {} if the unit differs, or else widen [prior]",
                    conversion(factor)
                ),
            ));
            factors[j] = factor;
        } else if beyond(own, UNLIKE) {
            findings.push(Finding::warning(
                "scale",
                format!("{given}; check its unit, and widen [prior] if the unit is right"),
            ));
        }
    }
    let pass = "outputs vary as runs of the twin do";
    match runs.is_empty() {
        true => {
            let message = "the twin diverges under the record's inputs at every point of its prior; check units and [prior]";
            (vec![Finding::warning("scale", message)], factors)
        }
        false => (or_pass(findings, "scale", pass), factors),
    }
}

/// Factors that a unit may be off by, the nearest first.
fn powers() -> impl Iterator<Item = f64> {
    (1..=POWERS).flat_map(|n| [10f64.powi(n), 10f64.powi(-n)])
}

fn conversion(factor: f64) -> String {
    match factor > 1.0 {
        true => format!("divide it by {}", text(factor)),
        false => format!("multiply it by {}", text(1.0 / factor)),
    }
}

/// The record with channels divided by these factors.
pub(super) fn divided(record: &Record, factors: &[f64], side: Side) -> Result<Record, RecordError> {
    let scaled = |signal: &Signal| {
        let mut signal = signal.clone();
        for (mut column, factor) in signal.columns_mut().into_iter().zip(factors) {
            if *factor != 1.0 {
                column.mapv_inplace(|value| value / factor);
            }
        }
        signal
    };
    let drive = record.drive();
    match side {
        Side::Inputs => Record::new(
            drive.with_inputs(scaled(drive.inputs()))?,
            record.outputs().clone(),
        ),
        Side::Outputs => Record::new(drive.clone(), scaled(record.outputs())),
    }
}
