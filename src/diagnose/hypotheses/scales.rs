//! Scales of a record: sizes of its signals and states.

use crate::effect::TargetKind;
use crate::record::{Record, Signal};

/// Records and states that the units of a dictionary are taken from.
pub(in crate::diagnose) struct Scales<'a> {
    pub records: &'a [Record],
    /// Filtered states of each record at θ̂.
    pub states: &'a [Signal],
}

impl Scales<'_> {
    /// Values of a sensor, actuator or state, of all records.
    pub fn columns(&self, kind: TargetKind, target: usize) -> Vec<f64> {
        let column = |signal: &Signal| -> Vec<f64> {
            if target < signal.ncols() {
                let values = signal.column(target).into_iter().copied();
                values.filter(|v| !v.is_nan()).collect()
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

    /// Step in seconds; the median one where steps vary.
    pub fn dt(&self) -> f64 {
        self.records[0].drive().dt()
    }

    /// Length of the longest record in seconds.
    pub fn duration(&self) -> f64 {
        let ends = self.records.iter().map(|r| r.drive().time(r.samples()));
        ends.fold(0.0, f64::max)
    }
}
