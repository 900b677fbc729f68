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
        let rates = match shown(twin) {
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

    /// Rates and outputs of the twin, or of one with more terms but no more states, each in units of the record, at so many moments of each
    /// record.
    pub fn equations_at(&self, twin: &Twin, theta: &[f64], moments: usize) -> Option<Vec<f64>> {
        let twin = shown(twin)?;
        let outline = twin.outline();
        let mut rates = vec![0.0; self.rates.len()];
        let mut outputs = vec![0.0; outline.outputs.len()];
        if outline.states.len() != rates.len() {
            return None;
        }
        let sizes: Vec<f64> = (0..outputs.len())
            .map(|j| self.size(TargetKind::Sensor, j))
            .collect();
        let units: Vec<f64> = (self.rates.iter().chain(&sizes))
            .map(|unit| if *unit > 0.0 { *unit } else { 1.0 })
            .collect();
        let mut all = vec![];
        for (record, states) in self.records.iter().zip(&self.states) {
            let acting = Acting::of(twin, theta, record.drive()).ok()?;
            let count = moments.min(record.samples());
            for k in (0..count).map(|m| m * record.samples() / count) {
                let (now, x) = (acting.at(k, theta), states.row(k).to_vec());
                twin.drift(&now, &x, &mut rates);
                twin.observe(&now, &x, &mut outputs);
                let values = rates.iter().chain(&outputs).zip(&units);
                all.extend(values.map(|(value, unit)| value / unit));
            }
        }
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

/// Equations, where the twin shows them.
fn shown(twin: &Twin) -> Option<&dyn StateSpace> {
    twin.equations()
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
