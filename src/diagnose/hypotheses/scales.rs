//! Sizes of a record's signals, states and rates: the units that hypotheses are looked for in.

use crate::effect::TargetKind;
use crate::math::deviation;
use crate::record::{Record, Signal};
use crate::twin::{Acting, Outline, StateSpace, Twin};

/// Records, the states that the twin has along them, and how fast these move.
pub(in crate::diagnose) struct Scales<'a> {
    pub records: &'a [Record],
    /// Filtered states of each record; a black box's predicted outputs.
    pub states: Vec<Signal>,
    pub outline: Outline,
    /// Root mean square of each state's rate by the twin's equations; empty without equations.
    pub rates: Vec<f64>,
    /// States whose rate is another state by definition.
    pub defined: Vec<bool>,
}

impl<'a> Scales<'a> {
    pub fn new(
        twin: &Twin,
        theta: &[f64],
        records: &'a [Record],
        states: Vec<Signal>,
        outline: Outline,
    ) -> Self {
        let rates = match twin.equations() {
            Some(equations) => rates(equations, theta, records, &states),
            None => vec![],
        };
        Self {
            records,
            states,
            outline,
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
        let column = |signal: &Signal| -> Vec<f64> {
            if target < signal.ncols() {
                let values = signal.column(target).into_iter().copied();
                values.filter(|v| v.is_finite()).collect()
            } else {
                vec![]
            }
        };
        let all: Vec<Vec<f64>> = match kind {
            TargetKind::Sensor => self.records.iter().map(|r| column(r.outputs())).collect(),
            TargetKind::Actuator => (self.records.iter())
                .map(|r| column(r.drive().inputs()))
                .collect(),
            _ => self.states.iter().map(column).collect(),
        };
        all.concat()
    }

    /// Deviation of the values there; a share of the largest one where nothing moves.
    pub fn size(&self, kind: TargetKind, target: usize) -> f64 {
        let values = self.columns(kind, target);
        let largest = values.iter().fold(0.0, |a: f64, v| a.max(v.abs()));
        let size = deviation(&values).max(1e-3 * largest);
        if size > 0.0 { size } else { 1.0 }
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

/// Root mean square of the rates along states.
fn rates(twin: &dyn StateSpace, theta: &[f64], records: &[Record], states: &[Signal]) -> Vec<f64> {
    let n = twin.outline().states.len();
    let (mut squares, mut count) = (vec![0.0; n], 0.0);
    for (record, states) in records.iter().zip(states) {
        let Ok(acting) = Acting::of(twin, theta, record.drive()) else {
            continue;
        };
        for k in 0..record.samples() {
            let mut rate = vec![0.0; n];
            twin.drift(&acting.at(k, theta), &states.row(k).to_vec(), &mut rate);
            for (square, rate) in squares.iter_mut().zip(rate) {
                if rate.is_finite() {
                    *square += rate * rate;
                }
            }
            count += 1.0;
        }
    }
    squares.iter().map(|s: &f64| (s / count).sqrt()).collect()
}
