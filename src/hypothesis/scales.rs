//! Sizes of a record's signals, states and rates: the units that hypotheses are looked for in.

use crate::effect::TargetKind;
use crate::fit::problem::Problem;
use crate::hypothesis::limits::TERM;
use crate::math::deviation;
use crate::record::{Record, Signal};
use crate::twin::{Acting, Outline, Parameter, Twin};
use std::ops::RangeInclusive;
use std::sync::Arc;

/// Changes of rates and outputs, as shares of what they vary, that neither rounding nor a bent law spoils.
const SEEN: RangeInclusive<f64> = 1e-8..=0.1;

/// Records, the states that the twin has along them, and how fast these move.
pub(crate) struct Scales {
    pub records: Arc<[Record]>,
    /// Filtered states of each record; a black box's predicted outputs.
    pub states: Vec<Signal>,
    /// Filtered states at the prior's centre: what no sensor shows has another size at each θ. Empty for a black box.
    pub before: Vec<Signal>,
    pub outline: Outline,
    /// Root mean square of each state's rate by the twin's equations; empty without equations.
    pub rates: Vec<f64>,
    /// States whose rate is another state by definition.
    pub defined: Vec<bool>,
}

impl Scales {
    pub fn new(twin: &Twin, theta: &[f64], problem: &Problem, states: Vec<Signal>) -> Self {
        let records = problem.records.clone();
        let rates = rates(twin, theta, &records, &states).unwrap_or_default();
        let before = match problem.is_simulated() {
            true => vec![],
            false => problem.states(&problem.centre()).unwrap_or_default(),
        };
        Self {
            records,
            states,
            before: before.into_iter().map(|(_, states)| states).collect(),
            outline: problem.outline(),
            rates,
            defined: twin.defined_states(),
        }
    }

    /// Returns whether the twin shows equations.
    pub fn has_equations(&self) -> bool {
        !self.rates.is_empty()
    }

    /// Values of a sensor, actuator or state, of all records.
    pub fn columns(&self, kind: TargetKind, target: usize) -> Vec<f64> {
        match kind {
            TargetKind::Sensor => column(self.records.iter().map(Record::outputs), target),
            TargetKind::Actuator => column(self.records.iter().map(|r| r.drive().inputs()), target),
            _ => column(&self.states, target),
        }
    }

    /// Values of a state at the prior's centre; none of others.
    pub fn before(&self, kind: TargetKind, target: usize) -> Vec<f64> {
        match kind {
            TargetKind::State => column(&self.before, target),
            _ => vec![],
        }
    }

    /// Deviation of the values there; a share of the largest one where nothing moves.
    pub fn size(&self, kind: TargetKind, target: usize) -> f64 {
        let values = self.columns(kind, target);
        let largest = values.iter().fold(0.0, |a: f64, v| a.max(v.abs()));
        let size = deviation(&values).max(1e-3 * largest);
        if size > 0.0 { size } else { 1.0 }
    }

    /// Rates and outputs of the twin, or of one with more terms but no more states, each in units of the record, at so many moments of each
    /// record.
    pub fn equations_at(&self, twin: &Twin, theta: &[f64], moments: usize) -> Option<Vec<f64>> {
        if twin.outline()?.states.len() != self.rates.len() {
            return None;
        }
        let sizes = (0..self.outline.outputs.len()).map(|j| self.size(TargetKind::Sensor, j));
        let units: Vec<f64> = (self.rates.iter().copied().chain(sizes))
            .map(|unit| if unit > 0.0 { unit } else { 1.0 })
            .collect();
        let mut all = vec![];
        let (records, states) = (&self.records, &self.states);
        each_moment(twin, theta, (records, states), moments, |rates, outputs| {
            let values = rates.iter().chain(outputs).zip(&units);
            all.extend(values.map(|(value, unit)| value / unit));
        })?;
        Some(all)
    }

    /// Step in seconds; the median one where steps vary.
    pub fn dt(&self) -> f64 {
        self.records[0].drive().dt()
    }

    /// Length of the longest record in seconds.
    pub fn duration(&self) -> f64 {
        let ends = self.records.iter().map(|r| r.drive().time(r.samples() - 1));
        ends.fold(0.0, f64::max)
    }
}

/// Finite values of a column of signals; none where they lack it.
fn column<'s>(signals: impl IntoIterator<Item = &'s Signal>, target: usize) -> Vec<f64> {
    let having = (signals.into_iter()).filter(|signal| target < signal.ncols());
    let values = having.flat_map(|signal| signal.column(target).to_vec());
    values.filter(|v| v.is_finite()).collect()
}

/// Root mean square of the rates along states.
fn rates(twin: &Twin, theta: &[f64], records: &[Record], states: &[Signal]) -> Option<Vec<f64>> {
    let mut squares = vec![0.0; twin.outline()?.states.len()];
    let mut count = 0.0;
    each_moment(twin, theta, (records, states), usize::MAX, |rates, _| {
        for (square, rate) in squares.iter_mut().zip(rates) {
            if rate.is_finite() {
                *square += rate * rate;
            }
        }
        count += 1.0;
    })?;
    Some(squares.iter().map(|s: &f64| (s / count).sqrt()).collect())
}

/// Hands on rates and outputs at so many moments of each record, or at every row. A record whose inputs the twin cannot follow is left out.
fn each_moment(
    twin: &Twin,
    theta: &[f64],
    (records, states): (&[Record], &[Signal]),
    moments: usize,
    mut then: impl FnMut(&[f64], &[f64]),
) -> Option<()> {
    let twin = twin.equations()?;
    let outline = twin.outline();
    let mut rates = vec![0.0; outline.states.len()];
    let mut outputs = vec![0.0; outline.outputs.len()];
    for (record, states) in records.iter().zip(states) {
        let Ok(acting) = Acting::of(twin, theta, record.drive()) else {
            continue;
        };
        let count = moments.min(record.samples());
        for k in (0..count).map(|m| m * record.samples() / count) {
            let (now, x) = (acting.at(k), states.row(k).to_vec());
            twin.drift(&now, &x, &mut rates);
            twin.observe(&now, &x, &mut outputs);
            then(&rates, &outputs);
        }
    }
    Some(())
}

/// The size of entry `j` of the θ of equations at which rates or outputs change as much as they vary themselves, along filtered states; none where
/// nothing changes.
pub(super) fn largest(
    twin: &Twin,
    theta: &[f64],
    (j, parameter): (usize, &Parameter),
    records: &[Record],
    states: &[Signal],
) -> Option<f64> {
    let prior = parameter.prior;
    let mut step = TERM.change * prior.high().abs().max(prior.low().abs());
    for _ in 0..TERM.looks {
        let mut moved = theta.to_vec();
        moved[j] = parameter.bounds.clamp(moved[j] + step);
        step = moved[j] - theta[j];
        if step == 0.0 {
            return None;
        }
        let change = change(twin, [theta, &moved], records, states)?;
        // Starts are for signals of size 1; those of others are lost in rounding, or bend the twin.
        match change {
            0.0 => step *= TERM.farther,
            c if SEEN.contains(&c) => return Some(step.abs() / c),
            c if c.is_finite() => step *= TERM.change / c,
            _ => step /= TERM.farther,
        }
    }
    None
}

/// The largest change of a rate or an output from the first θ to the second along filtered states, as a share of what it varies itself
/// (root mean squares). Rates count from zero, outputs from their mean. `None` without equations.
fn change(twin: &Twin, thetas: [&[f64]; 2], records: &[Record], states: &[Signal]) -> Option<f64> {
    let rates = twin.outline()?.states.len();
    let mut all: [Vec<Vec<f64>>; 2] = [vec![], vec![]];
    for (theta, rows) in thetas.iter().zip(&mut all) {
        each_moment(
            twin,
            theta,
            (records, states),
            usize::MAX,
            |rates, outputs| {
                rows.push([rates, outputs].concat());
            },
        )?;
    }
    let [here, there] = all;
    if here.len() != there.len() || here.is_empty() {
        return Some(f64::NAN);
    }
    let share = |i: usize| {
        let mean =
            |f: &dyn Fn(usize) -> f64| (0..here.len()).map(f).sum::<f64>() / here.len() as f64;
        let whole = mean(&|k| here[k][i].powi(2));
        let centre = if i < rates {
            0.0
        } else {
            mean(&|k| here[k][i])
        };
        let own = whole - centre * centre;
        match own > 0.0 {
            true => (mean(&|k| (there[k][i] - here[k][i]).powi(2)) / own).sqrt(),
            false => 0.0,
        }
    };
    Some((0..here[0].len()).map(share).fold(0.0, f64::max))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::{Catalogue, augment};
    use crate::record::Drive;
    use crate::twin::{Now, Outline, StateSpace};

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
