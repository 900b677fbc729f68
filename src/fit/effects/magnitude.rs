//! Sizes of effects: as large as the twin's own terms.

use crate::effect::{Effect, Magnitude, Shape, TargetKind, targets};
use crate::fit::axis::{Axis, EvidencePrior};
use crate::math::{ends, quantile};
use crate::record::{Record, Signal};
use crate::twin::{Acting, Interval, Parameter, StateSpace, Twin};
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// Change of a magnitude whose consequences are looked at, as a share of where fits start; where those are far off, of what the rates vary.
const SHARE: f64 = 1e-3;
/// Changes of rates and outputs, as shares of what they vary, that neither rounding nor a bent law spoils.
const SEEN: RangeInclusive<f64> = 1e-8..=0.1;
/// Factor to a change that is seen from one that is not, and how often it is looked for.
const FARTHER: f64 = 1e5;
const LOOKS: usize = 5;
/// Longest lag or delay, as a share of the record: a longer one shows fewer than four times, and passes for the twin's own motion. At half
/// of it, a delay of 0.15 records is told as two shorter ones.
pub(crate) const LONGEST: f64 = 0.25;
/// Factor from one lag or delay that is tried to the next.
const FACTOR: f64 = 3.0;

/// Levels that are tried for a threshold: shares of the values that lie below an upper one, above a lower one.
const LEVELS: [f64; 6] = [0.97, 0.9, 0.8, 0.65, 0.5, 0.35];
/// Part of their range by which a threshold on states or outputs may lie beyond it: states move with θ, and predictions scatter.
const BEYOND: f64 = 0.5;
/// Longest step of a fit to a level, in its range. A step that is cut is cut for θ, too: with 0.15, diagnoses of real tanks with a ceiling
/// ended 50 nats short.
const LONGEST_TO_LEVEL: f64 = 0.5;
/// Limits of a rate that are tried, as shares of the fastest step of the record.
const RATES: [f64; 5] = [0.02, 0.05, 0.1, 0.2, 0.5];

/// Kind of an effect's magnitude.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Kind {
    /// A size, off at this value.
    Size(f64),
    /// A threshold, a lag, a delay: uniform over what a record can show, off at one end.
    Switch {
        low: f64,
        high: f64,
        off: f64,
        of: Switch,
        /// Values to try.
        grid: Vec<f64>,
    },
    /// A time or a frequency: uniform over what a record can show.
    Shape { low: f64, high: f64 },
    /// Anything else: normal, as its parameter's prior says.
    Other,
}

/// Magnitude that is off at an end of its range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Switch {
    /// A threshold.
    Level,
    /// A lag or a delay.
    Time,
    /// The limit of a rate, a range of factors.
    Rate,
}

impl Kind {
    /// Axis of a magnitude whose kind needs no states of the twin.
    pub fn axis(&self, parameter: &Parameter) -> Axis {
        match self {
            Self::Switch { low, high, of, .. } => match of {
                Switch::Level => level_axis(parameter, (*low, *high)),
                Switch::Time => uniform_axis(parameter, (*low, *high), false),
                Switch::Rate => uniform_axis(parameter, (*low, *high), true),
            },
            Self::Shape { low, high } => shape_axis(parameter, *low, *high),
            Self::Size(_) | Self::Other => Axis::of(parameter),
        }
    }

    /// Value at which the magnitude is off, or in the middle of its range where it has no effect of its own.
    pub fn off(&self, parameter: &Parameter) -> f64 {
        let value = match self {
            Self::Size(off) | Self::Switch { off, .. } => *off,
            Self::Shape { low, high } => 0.5 * (low + high),
            Self::Other => parameter.prior.centre(),
        };
        parameter.bounds.clamp(value)
    }
}

/// Kinds of magnitudes of effects by their name in θ, on these records. Thresholds on states are told from `states`; where none are
/// given they lie out of reach.
pub(crate) fn kinds(
    twin: &Twin,
    effects: &[Effect],
    records: &[Record],
    states: &[Signal],
) -> BTreeMap<String, Kind> {
    let duration = duration(records);
    let dt = records[0].drive().dt();
    let kind = |effect: &Effect, m: &Magnitude| match (m.shape, m.off) {
        (Shape::Rate, Some(off)) if off.is_infinite() => {
            rate_limit(&values_at(twin, effect, records, states), dt, duration)
        }
        (_, Some(off)) if off.is_infinite() => {
            let is_known = effect.law().target() == TargetKind::Actuator;
            threshold(&values_at(twin, effect, records, states), off, is_known)
        }
        (Shape::Frequency, _) => Kind::Shape {
            low: 0.5 / duration,
            high: 0.5 / dt,
        },
        (Shape::Delay | Shape::TimeConstant, Some(off)) => {
            let mut longest = LONGEST * duration;
            if let Some(most) = effect.kind().longest_dead_time(dt) {
                longest = longest.min(most);
            }
            Kind::Switch {
                low: 0.0,
                high: longest,
                off,
                of: Switch::Time,
                grid: std::iter::successors(Some(dt), |v| Some(FACTOR * v))
                    .take_while(|v| *v <= longest)
                    .collect(),
            }
        }
        (Shape::Time, _) => Kind::Shape {
            low: 0.0,
            high: duration,
        },
        (_, Some(off)) => Kind::Size(off),
        _ => Kind::Other,
    };
    (effects.iter())
        .flat_map(|effect| {
            let name = |m: &Magnitude| effect.key().magnitude(m.name);
            (effect.magnitudes().iter()).map(move |m| (name(m), kind(effect, m)))
        })
        .collect()
}

/// Values of the sensor, actuator or state that an effect stands at.
fn values_at(twin: &Twin, effect: &Effect, records: &[Record], states: &[Signal]) -> Vec<f64> {
    let kind = effect.law().target();
    let known = targets(kind, twin.outline().as_ref(), &twin.signals());
    let Some(target) = known.iter().position(|name| name == effect.target()) else {
        return vec![];
    };
    let column = |signal: &Signal| -> Vec<f64> {
        match target < signal.ncols() {
            true => signal.column(target).to_vec(),
            false => vec![],
        }
    };
    let all: Vec<Vec<f64>> = match kind {
        TargetKind::Sensor => records.iter().map(|r| column(r.outputs())).collect(),
        TargetKind::Actuator => (records.iter())
            .map(|r| column(r.drive().inputs()))
            .collect(),
        _ => states.iter().map(column).collect(),
    };
    all.into_iter()
        .flatten()
        .filter(|v| v.is_finite())
        .collect()
}

/// Levels of a threshold that are worth a try.
pub(crate) fn levels(values: &[f64], is_upper: bool) -> Vec<f64> {
    (LEVELS.iter())
        .filter_map(|p| quantile(values, if is_upper { *p } else { 1.0 - p }).ok())
        .collect()
}

/// Kind of a threshold, off at an infinite level; a level beyond the values is as good.
fn threshold(values: &[f64], off: f64, is_known: bool) -> Kind {
    if values.is_empty() {
        return Kind::Size(off);
    }
    let (low, high) = ends(values);
    let is_upper = off > 0.0;
    let beyond = if is_known { 0.0 } else { BEYOND * (high - low) };
    let (low, high) = match is_upper {
        true => (low, high + beyond),
        false => (low - beyond, high),
    };
    Kind::Switch {
        low,
        high,
        off: if is_upper { high } else { low },
        of: Switch::Level,
        grid: levels(values, is_upper),
    }
}

/// Kind of the limit of a rate: beyond the fastest step of the record it is off, below the slowest wander nothing passes.
fn rate_limit(values: &[f64], dt: f64, duration: f64) -> Kind {
    let (low, high) = match values.is_empty() {
        true => (0.0, 1.0),
        false => ends(values),
    };
    let fastest = (high - low).max(1e-9) / dt;
    Kind::Switch {
        low: fastest * dt / duration,
        high: fastest,
        off: fastest,
        of: Switch::Rate,
        grid: RATES.map(|share| share * fastest).to_vec(),
    }
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
    let prior = parameter.prior;
    let mut step = SHARE * prior.high().abs().max(prior.low().abs());
    for _ in 0..LOOKS {
        let mut moved = theta.to_vec();
        moved[j] = parameter.bounds.clamp(moved[j] + step);
        step = moved[j] - theta[j];
        if step == 0.0 {
            return None;
        }
        let change = change(twin, [theta, &moved], records, states);
        // Starts are for signals of size 1; those of others are lost in rounding, or bend the twin.
        match change {
            0.0 => step *= FARTHER,
            c if SEEN.contains(&c) => return Some(step.abs() / c),
            c if c.is_finite() => step *= SHARE / c,
            _ => step /= FARTHER,
        }
    }
    None
}

/// The largest change of a rate or an output from the first θ to the second along filtered states, as a share of what it varies itself
/// (root mean squares). Rates count from zero, outputs from their mean.
fn change(
    twin: &dyn StateSpace,
    [theta, moved]: [&[f64]; 2],
    records: &[Record],
    states: &[Signal],
) -> f64 {
    let outline = twin.outline();
    let (n, p) = (outline.states.len(), outline.outputs.len());
    let (mut change, mut whole, mut total) = (vec![0.0; n + p], vec![0.0; n + p], vec![0.0; n + p]);
    let mut rows = 0.0;
    for (record, states) in records.iter().zip(states) {
        let acting = |theta| Acting::of(twin, theta, record.drive());
        let (Ok(here), Ok(there)) = (acting(theta), acting(moved)) else {
            return f64::NAN;
        };
        for k in 0..record.samples() {
            let x: Vec<f64> = states.row(k).to_vec();
            let at = |acting: &Acting<'_>, theta: &[f64]| -> Vec<f64> {
                let now = acting.at(k, theta);
                let mut values = vec![0.0; n + p];
                let (rates, outputs) = values.split_at_mut(n);
                twin.drift(&now, &x, rates);
                twin.observe(&now, &x, outputs);
                values
            };
            let (here, there) = (at(&here, theta), at(&there, moved));
            rows += 1.0;
            for i in 0..n + p {
                change[i] += (there[i] - here[i]).powi(2);
                whole[i] += here[i] * here[i];
                total[i] += here[i];
            }
        }
    }
    (0..n + p)
        .map(|i| {
            let mean = if i < n { 0.0 } else { total[i] / rows };
            let own = whole[i] / rows - mean * mean;
            if own > 0.0 {
                (change[i] / rows / own).sqrt()
            } else {
                0.0
            }
        })
        .fold(0.0, f64::max)
}

/// Axis of a shape that is uniform over a range.
pub(crate) fn shape_axis(parameter: &Parameter, low: f64, high: f64) -> Axis {
    let (low, high) = (
        low.max(parameter.bounds.low()),
        high.min(parameter.bounds.high()),
    );
    let axis = Axis::of(parameter);
    if low < high && !axis.is_log {
        Axis {
            evidence: EvidencePrior::Uniform { low, high },
            ..axis
        }
    } else {
        axis
    }
}

/// Axis of a magnitude that is uniform over a range, or in its logarithm; the user's bounds are kept. A level has no zero of its own, and
/// is never taken in its logarithm.
pub(crate) fn uniform_axis(parameter: &Parameter, (low, high): (f64, f64), is_log: bool) -> Axis {
    let bounds = Interval::unchecked(
        low.max(parameter.bounds.low()),
        high.min(parameter.bounds.high()),
    );
    let axis = Axis::of(parameter);
    if bounds.low() >= bounds.high() {
        return axis;
    }
    let [low, high] = [bounds.low(), bounds.high()].map(|v| if is_log { v.ln() } else { v });
    let (centre, width) = (0.5 * (low + high), high - low);
    Axis {
        bounds,
        is_log,
        centre: if is_log { centre.exp() } else { centre },
        deviation: 2.0 * width,
        longest: 0.15 * width,
        width: if is_log { 1.0 } else { 0.05 * width },
        evidence: EvidencePrior::Uniform { low, high },
        ..axis
    }
}

/// Axis of a threshold: uniform over a range, and with longer steps.
pub(crate) fn level_axis(parameter: &Parameter, (low, high): (f64, f64)) -> Axis {
    Axis {
        longest: LONGEST_TO_LEVEL * (high - low),
        ..uniform_axis(parameter, (low, high), false)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::{Catalogue, augment};
    use crate::record::Drive;
    use crate::twin::{Now, Outline};

    /// ẋ = g·(u − x), x in a unit of anybody's choice.
    struct Level(f64);

    impl StateSpace for Level {
        fn outline(&self) -> Outline {
            Outline::new()
                .parameter(Parameter::new("g", "1/s", 0.5, 2.0))
                .state("x", "m")
                .input("u", "m")
                .output("y", "m")
        }
        fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
            dx[0] = now.theta[0] * (now.u[0] - x[0]);
        }
        fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
            y[0] = x[0] / self.0;
        }
    }

    /// The largest drag c·x² is as many times smaller as numbers are larger.
    #[test]
    fn the_largest_size_follows_the_unit() {
        let of_unit = |unit: f64| {
            let drag = Catalogue::default().effect("quadratic-drag", "x").unwrap();
            let twin = augment(Twin::new(Level(unit)), vec![drag]).unwrap();
            let rows = |phase: usize| {
                Signal::from_shape_fn((50, 1), |(k, _)| unit * (1 + (k + phase) % 7) as f64)
            };
            let drive = Drive::new(0.1, rows(0)).unwrap();
            let record = Record::new(drive, rows(3).mapv(|x| x / unit)).unwrap();
            let space = twin.parameters();
            let entry = (1, &space[1]);
            largest(&twin, &[1.0, 0.0], entry, &[record], &[rows(3)]).unwrap()
        };
        let one = of_unit(1.0);
        for unit in [1e-12, 1e-6, 1e3, 1e9] {
            let ratio = of_unit(unit) * unit / one;
            assert!((ratio - 1.0).abs() < 1e-3, "unit {unit:e}: {ratio}");
        }
    }
}
