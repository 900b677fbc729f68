//! Sizes of a record's signals, states and rates: the units that hypotheses are looked for in.

use crate::effect::TargetKind;
use crate::math::deviation;
use crate::record::{Record, Signal};
use crate::twin::{Acting, Outline, Twin};
use std::sync::Arc;

/// Records, the states that the twin has along them, and how fast these move.
pub(crate) struct Scales {
    pub records: Arc<[Record]>,
    /// Filtered states of each record; a black box's predicted outputs.
    pub states: Vec<Signal>,
    pub outline: Outline,
    /// Root mean square of each state's rate by the twin's equations; empty without equations.
    pub rates: Vec<f64>,
    /// States whose rate is another state by definition.
    pub defined: Vec<bool>,
}

impl Scales {
    pub fn new(
        twin: &Twin,
        theta: &[f64],
        records: Arc<[Record]>,
        states: Vec<Signal>,
        outline: Outline,
    ) -> Self {
        let rates = rates(twin, theta, &records, &states).unwrap_or_default();
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
            let (now, x) = (acting.at(k, theta), states.row(k).to_vec());
            twin.drift(&now, &x, &mut rates);
            twin.observe(&now, &x, &mut outputs);
            then(&rates, &outputs);
        }
    }
    Some(())
}
