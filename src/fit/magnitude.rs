//! Sizes of effects: as large as the twin's own terms.

use super::axis::{Axis, EvidencePrior};
use crate::effect::{Effect, Magnitude};
use crate::record::{Record, Signal};
use crate::twin::{Now, Parameter, Twin};
use std::collections::BTreeMap;

/// Change of a magnitude whose consequences are looked at, as a share of where fits start.
const SHARE: f64 = 1e-3;
/// Longest lag or delay, as a share of the record: a longer one is seen too rarely to be told from the twin's own motion.
const LONGEST: f64 = 0.125;

/// Kind of an effect's magnitude.
pub(crate) enum Kind {
    /// A size, off at this value.
    Size(f64),
    /// A time, a frequency, a delay: uniform over what a record can show.
    Shape { low: f64, high: f64 },
    /// Anything else: normal, as its parameter's prior says.
    Other,
}

/// Kinds of magnitudes of effects by their name in θ, on these records.
pub(crate) fn kinds(effects: &[Effect], records: &[Record]) -> BTreeMap<String, Kind> {
    let duration = duration(records);
    let dt = records[0].drive().dt();
    let kind = |m: &Magnitude| match (m.unit, m.off) {
        ("Hz", _) => Kind::Shape {
            low: 0.5 / duration,
            high: 0.5 / dt,
        },
        ("s", Some(_)) => Kind::Shape {
            low: 0.0,
            high: LONGEST * duration,
        },
        ("s", None) => Kind::Shape {
            low: 0.0,
            high: duration,
        },
        (_, Some(off)) if off.is_finite() => Kind::Size(off),
        _ => Kind::Other,
    };
    (effects.iter())
        .flat_map(|effect| {
            let name = |m: &Magnitude| effect.key().magnitude(m.name);
            effect.magnitudes().iter().map(move |m| (name(m), kind(m)))
        })
        .collect()
}

/// Length of the longest record, in seconds.
pub(super) fn duration(records: &[Record]) -> f64 {
    (records.iter())
        .map(|r| r.drive().time(r.samples() - 1))
        .fold(0.0, f64::max)
}

/// The size of entry `j` of the θ of equations at which rates or outputs change as much as they vary themselves, along filtered states; none where
/// nothing changes.
pub(crate) fn largest(
    twin: &Twin,
    theta: &[f64],
    (j, parameter): (usize, &Parameter),
    records: &[Record],
    states: &[Signal],
) -> Option<f64> {
    let twin = twin.equations()?;
    let outline = twin.outline();
    let (n, p) = (outline.states.len(), outline.outputs.len());
    let step = SHARE
        * parameter
            .prior
            .high()
            .abs()
            .max(parameter.prior.low().abs());
    let mut moved = theta.to_vec();
    moved[j] += step;
    let mut change = vec![0.0; n + p];
    let mut whole = vec![0.0; n + p];
    let mut totals = (vec![0.0; n + p], 0.0);
    for (record, states) in records.iter().zip(states) {
        for k in 0..record.samples() {
            let x: Vec<f64> = states.row(k).to_vec();
            let at = |theta: &[f64]| -> Vec<f64> {
                let drive = record.drive();
                let now = Now::new(drive.time(k), drive.step(k), drive.input(k), theta);
                let mut values = vec![0.0; n + p];
                let (rates, outputs) = values.split_at_mut(n);
                twin.drift(&now, &x, rates);
                twin.observe(&now, &x, outputs);
                values
            };
            let (here, there) = (at(theta), at(&moved));
            totals.1 += 1.0;
            for i in 0..n + p {
                change[i] += (there[i] - here[i]).powi(2);
                whole[i] += here[i] * here[i];
                totals.0[i] += here[i];
            }
        }
    }
    // Rates count from zero, outputs from their mean.
    let share = (0..n + p)
        .map(|i| {
            let mean = if i < n { 0.0 } else { totals.0[i] / totals.1 };
            let own = whole[i] / totals.1 - mean * mean;
            let changed = change[i] / totals.1 / (step * step);
            if own > 0.0 {
                (changed / own).sqrt()
            } else {
                0.0
            }
        })
        .fold(0.0, f64::max);
    (share > 0.0 && share.is_finite()).then_some(1.0 / share)
}

/// Axis of a shape that is uniform over a range.
pub(crate) fn shape_axis(parameter: &Parameter, low: f64, high: f64) -> Axis {
    let (low, high) = (
        low.max(parameter.bounds.low()),
        high.min(parameter.bounds.high()),
    );
    let axis = Axis::of(parameter);
    if low < high && !axis.is_log() {
        Axis {
            evidence: EvidencePrior::Uniform { low, high },
            ..axis
        }
    } else {
        axis
    }
}

/// Axis of the size of an effect that is as large as the twin's own terms at `largest`.
pub(crate) fn size_axis(parameter: &Parameter, largest: f64) -> Axis {
    Axis {
        centre: 0.0,
        deviation: 2.0 * largest,
        width: largest,
        longest: largest,
        evidence: EvidencePrior::Magnitude { largest },
        ..Axis::of(parameter)
    }
}
