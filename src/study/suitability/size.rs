//! Inputs outside the plan, and units that are off by a power of ten.

use super::limits::LIMITS;
use super::{or_pass, present, text, with_unit};
use crate::math::{deviation, ends, is_constant, largest, median};
use crate::record::{Drive, Record, RecordError, Signal};
use crate::study::Study;
use crate::twin::conformance::Finding;

/// Share of the largest planned input that the largest one of a record reaches in the right unit.
const REACHED: (f64, f64) = (0.3, 1.05);

/// Checks inputs against the plan, small ones against further draws of it, too; also returns the power of ten that each is too large by.
pub(super) fn check_inputs(
    study: &Study,
    record: &Record,
    planned: Option<&Drive>,
    drawn: impl Fn(u64) -> Option<Drive>,
) -> (Vec<Finding>, Vec<f64>) {
    let inputs = study.twin().signals().inputs;
    let (mut findings, mut factors) = (vec![], vec![1.0; inputs.len()]);
    let Some(planned) = planned.filter(|_| !inputs.is_empty()) else {
        return (findings, factors);
    };
    let doses = study.twin().doses();
    for (j, input) in inputs.iter().enumerate() {
        let plan = study.plan().and_then(|plan| plan.input.as_ref());
        let (mut low, mut high) = (plan.and_then(|plan| plan.range(&input.name)))
            .unwrap_or_else(|| ends(&present(planned.inputs(), j).1));
        // Most rows have no dose.
        if doses.get(j) == Some(&true) {
            (low, high) = (low.min(0.0), high.max(0.0));
        }
        let (_, values) = present(record.drive().inputs(), j);
        let (least, most) = ends(&values);
        let stretch = |low: f64, high: f64| match low < high {
            true => format!("in {} to {}", text(low), with_unit(high, &input.unit)),
            false => format!("at {}", with_unit(high, &input.unit)),
        };
        let (measured, planned) = (stretch(least, most), stretch(low, high));
        let given = format!(
            "input {} lies {measured}, the study's {planned}",
            input.name
        );
        let most_planned = low.abs().max(high.abs());
        let reach_of = |values: &[f64]| largest(values) / most_planned;
        let reach = reach_of(&values);
        // A short record may have small levels alone: as small as one of its length that is drawn.
        let is_small = |plan: Drive| {
            let plan = plan.first(record.samples());
            reach >= reach_of(&present(plan.inputs(), j).1) / LIMITS.doubted
        };
        let is_usual = || (0..LIMITS.draws).filter_map(&drawn).any(is_small);
        let in_reach = |factor: &f64| (REACHED.0..=REACHED.1).contains(&(reach / factor));
        let is_doubted =
            reach > LIMITS.doubted || reach < REACHED.0 / LIMITS.doubted && !is_usual();
        if is_doubted && let Some(factor) = powers().find(in_reach) {
            let message = format!("{given}; {} if the unit differs", conversion(factor));
            findings.push(Finding::warning("scale", message));
            factors[j] = factor;
            continue;
        }
        // Of an input that is to stay, the accuracy is a share of its value.
        let extent = if high > low { high - low } else { high.abs() };
        let margin = LIMITS.margin * extent;
        let range = low - margin..=high + margin;
        let outside = values.iter().filter(|v| !range.contains(v)).count();
        if outside > 0 {
            let message = format!(
                "{given}: {outside} of {} rows are outside; an estimator has not seen such inputs: widen the input of the study and train it again",
                values.len()
            );
            findings.push(Finding::warning("inputs", message));
        }
    }
    let findings = or_pass(findings, "inputs", "within the study's range");
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
    let mut moves = false;
    if runs.is_empty() {
        let message = "the twin diverges under the record's inputs at every point of its prior; check units and prior";
        return (vec![Finding::warning("scale", message)], factors);
    }
    for (j, output) in outputs.iter().enumerate() {
        let values = present(record.outputs(), j).1;
        let own = match is_constant(&values) {
            true => 0.0,
            false => deviation(&values),
        };
        let sizes = runs.iter().map(|run| deviation(&run.column(j).to_vec()));
        let sizes: Vec<f64> = sizes.collect();
        let (low, high) = ends(&sizes);
        let beyond = |size: f64, times: f64| size > times * high || size < low / times;
        moves |= own > 0.0;
        if own == 0.0 || low == 0.0 || !high.is_finite() || !beyond(own, LIMITS.doubted) {
            continue;
        }
        let Ok(middle) = median(&sizes) else {
            continue;
        };
        let off = |factor: &f64| (own / factor / middle).ln().abs();
        let nearest = powers()
            .filter(|factor| !beyond(own / factor, LIMITS.usual))
            .min_by(|a, b| off(a).total_cmp(&off(b)));
        let remedy = match nearest {
            Some(factor) => format!(
                "{} if the unit differs, or else widen the prior",
                conversion(factor)
            ),
            None if beyond(own, LIMITS.unlike) => {
                "check its unit, and widen the prior if the unit is right".into()
            }
            None => continue,
        };
        let message = format!(
            "output {} varies by {} rms, runs of the twin by {} to {}; {remedy}",
            output.name,
            with_unit(own, &output.unit),
            text(low),
            with_unit(high, &output.unit)
        );
        findings.push(Finding::warning("scale", message));
        factors[j] = nearest.unwrap_or(1.0);
    }
    if moves {
        findings = or_pass(findings, "scale", "outputs vary as runs of the twin do");
    }
    (findings, factors)
}

/// Factors that a unit may be off by, the nearest first.
fn powers() -> impl Iterator<Item = f64> {
    (1..=LIMITS.powers).flat_map(|n| [10f64.powi(n), 10f64.powi(-n)])
}

/// The remedy for values that are too large by a factor.
pub(super) fn conversion(factor: f64) -> String {
    match factor > 1.0 {
        true => format!("divide it by {}", text(factor)),
        false => format!("multiply it by {}", text(1.0 / factor)),
    }
}

/// The record with inputs divided by these factors.
pub(super) fn with_inputs_divided(record: Record, factors: &[f64]) -> Result<Record, RecordError> {
    let inputs = divided(record.drive().inputs(), factors);
    Record::new(
        record.drive().with_inputs(inputs)?,
        record.outputs().clone(),
    )
}

/// The record with outputs divided by these factors.
pub(super) fn with_outputs_divided(record: Record, factors: &[f64]) -> Result<Record, RecordError> {
    Record::new(record.drive().clone(), divided(record.outputs(), factors))
}

fn divided(signal: &Signal, factors: &[f64]) -> Signal {
    let mut signal = signal.clone();
    for (mut column, factor) in signal.columns_mut().into_iter().zip(factors) {
        column /= *factor;
    }
    signal
}
