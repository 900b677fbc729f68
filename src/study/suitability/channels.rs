//! Damaged channels: constant, clipped, quantised, with outliers.

use super::limits::LIMITS;
use super::{or_pass, present, text, with_unit};
use crate::effect::{OutputMark, clipped, rounded};
use crate::math::{CONSTANT, ends, is_constant, median, quantile};
use crate::record::{Drive, Record, Signal};
use crate::study::Study;
use crate::twin::conformance::Finding;

/// Interquartile range of a normal distribution, in standard deviations.
const QUARTILES: f64 = 1.349;
/// Standard deviation of a normal distribution, in median absolute deviations.
const MEDIANS: f64 = 1.4826;

/// Checks each channel; what one of the twin's own runs shows, too, is no fault.
pub(super) fn check(
    study: &Study,
    record: &Record,
    planned: Option<&Drive>,
    runs: &[Signal],
) -> Vec<Finding> {
    let signals = study.twin().signals();
    let mut findings = vec![];
    for (j, input) in signals.inputs.iter().enumerate() {
        let (_, values) = present(record.drive().inputs(), j);
        let moves = planned.is_none_or(|plan| !is_constant(&present(plan.inputs(), j).1));
        if moves && is_constant(&values) {
            let name = &input.name;
            let value = with_unit(values[0], &input.unit);
            findings.push(Finding::warning(
                "constant",
                format!("input {name} is {value} in every row: what acts through it cannot be told from a constant; take a record in which it moves, or fix its parameters"),
            ));
        }
    }
    for (j, output) in signals.outputs.iter().enumerate() {
        let (rows, values) = present(record.outputs(), j);
        let own: Vec<Vec<f64>> = runs.iter().map(|run| present(run, j).1).collect();
        let name = &output.name;
        let mut warn = |check, message| findings.push(Finding::warning(check, message));
        if is_constant(&values) {
            if !own.iter().any(|own| is_constant(own)) {
                let value = with_unit(values[0], &output.unit);
                warn(
                    "constant",
                    format!(
                        "output {name} is {value} in every row: the sensor does not work, or the column is another; take the right column, or leave the output out of the twin"
                    ),
                );
            }
            continue;
        }
        if let Some((end, value, count)) = clipped_ends(&values)
            && !own.iter().any(|own| clipped_ends(own).is_some())
        {
            let value = with_unit(value, &output.unit);
            warn(
                "clipped",
                format!(
                    "output {name} is at its {end} value {value} in {count} rows: the sensor's range ends there; empty those cells, or add the effect sensor-saturation"
                ),
            );
        }
        if let Some(step) = coarse_step(&values)
            && !own.iter().any(|own| coarse_step(own).is_some())
        {
            let step = with_unit(step, &output.unit);
            warn(
                "quantised",
                format!(
                    "output {name} moves in steps of {step}, fewer than {} in its range; log more digits, or add the effect sensor-quantization",
                    LIMITS.few_levels
                ),
            );
        }
        let outliers = outliers(&values);
        let is_usual = |own: &Vec<f64>| outliers.len() <= 2 * self::outliers(own).len();
        if !outliers.is_empty() && !own.iter().any(is_usual) {
            let largest = outliers.iter().map(|(_, z)| *z).fold(0.0, f64::max);
            let named: Vec<String> = (outliers.iter().take(LIMITS.named))
                .map(|(at, _)| record.drive().rows().line(rows[*at]).to_string())
                .collect();
            let more = if outliers.len() > LIMITS.named {
                ", …"
            } else {
                ""
            };
            warn(
                "outliers",
                format!(
                    "output {name} has outlying values in rows {}{more}: {} of them, up to {} deviations of the noise from their neighbours; empty those cells, or add the effect sensor-outliers",
                    named.join(", "),
                    outliers.len(),
                    text(largest)
                ),
            );
        }
    }
    or_pass(
        findings,
        "values",
        "no channel is constant, clipped, coarse or has outliers",
    )
}

/// The end that values pile up at, and how many of them.
fn clipped_ends(values: &[f64]) -> Option<(&'static str, f64, usize)> {
    let OutputMark::Present(limits) = clipped(values) else {
        return None;
    };
    let (low, high) = ends(values);
    let (name, end) = match limits[1].is_finite() {
        true => ("largest", high),
        false => ("least", low),
    };
    let at_end = |v: &&f64| (**v - end).abs() <= CONSTANT * (high - low);
    Some((name, end, values.iter().filter(at_end).count()))
}

/// The step of values that are few.
fn coarse_step(values: &[f64]) -> Option<f64> {
    let OutputMark::Present(steps) = rounded(values) else {
        return None;
    };
    let (low, high) = ends(values);
    (high - low < LIMITS.few_levels * steps[0]).then_some(steps[0])
}

/// Values far outside their neighbours, with the distance in deviations of the noise. Two neighbours on each side, without the least
/// and the greatest, span the range, so that edges are no outliers; the ends of the record have too few.
fn outliers(values: &[f64]) -> Vec<(usize, f64)> {
    if values.len() < LIMITS.fewest {
        return vec![];
    }
    // Values that stand still, as at an end of the range, tell nothing of noise.
    let moves: Vec<f64> = (values.windows(2))
        .map(|pair| (pair[1] - pair[0]).abs())
        .filter(|distance| *distance > 0.0)
        .collect();
    let quartile = |p: f64| quantile(values, p).unwrap_or(0.0);
    let least = LIMITS.smooth * (quartile(0.75) - quartile(0.25)) / QUARTILES;
    let noise = least.max(MEDIANS * median(&moves).unwrap_or(0.0) / 2f64.sqrt());
    (values.windows(2 * LIMITS.side + 1).zip(LIMITS.side..))
        .map(|(near, k)| {
            let mut others = [near[0], near[1], near[3], near[4]];
            others.sort_unstable_by(f64::total_cmp);
            let outside = (near[LIMITS.side] - others[2]).max(others[1] - near[LIMITS.side]);
            (k, outside / noise)
        })
        .filter(|(_, z)| *z > LIMITS.outlying)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outliers_are_seen_on_smooth_and_on_noisy_signals() {
        let smooth: Vec<f64> = (0..300)
            .map(|k| (f64::from(k) * 0.1).sin().powi(3))
            .collect();
        let edges: Vec<f64> = (0..300).map(|k| f64::from(k / 50 % 2)).collect();
        assert_eq!(outliers(&smooth), []);
        assert_eq!(outliers(&edges), []);
        assert_eq!(outliers(&smooth[..49]), []);
        let mut damaged = smooth;
        damaged[60] = 3.0;
        damaged[61] = 2.9;
        damaged[120] -= 2.0;
        let rows: Vec<usize> = outliers(&damaged).iter().map(|(k, _)| *k).collect();
        assert_eq!(rows, [60, 61, 120]);
    }
}
