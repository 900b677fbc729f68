//! Cuts of records into windows, regions, lags and bands.

use crate::diagnose::thresholds::THRESHOLDS;
use crate::likelihood::kalman::Filtered;
use crate::math::quantile;
use crate::record::{Record, Signal};
use crate::twin::Outline;

/// One piece of what was measured.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::diagnose) enum Cut {
    /// Samples of an output.
    Window {
        record: usize,
        channel: usize,
        from: usize,
        to: usize,
    },

    /// Samples with a variable in a range.
    Region {
        variable: usize,
        low: f64,
        high: f64,
    },
    /// An output.
    Channel { channel: usize },
    /// Correlation of an output with the past of a signal.
    Lag {
        channel: usize,
        past: Past,
        from: usize,
        to: usize,
    },
    /// Frequencies of an output's innovations, in cycles a sample.
    Band { channel: usize, low: f64, high: f64 },
}

/// The signal whose past counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::diagnose) enum Past {
    /// Innovations of an output.
    Output(usize),
    /// An input.
    Input(usize),
}

/// Cuts of a record and its simulations.
#[derive(Debug, Clone)]
pub(in crate::diagnose) struct Bins {
    pub cuts: Vec<Cut>,
    /// Names of states, inputs and outputs.
    pub variables: Vec<String>,
    /// Number of states among them.
    pub states: usize,
    /// Outputs among them.
    predicted: Vec<usize>,
}

impl Bins {
    /// Cuts filtered states and records.
    pub fn new(outline: &Outline, states: &[(Filtered, Signal)], records: &[Record]) -> Self {
        let own: Vec<String> = (outline.states.iter())
            .map(|s| s.name.clone())
            .take_while(|name| !crate::twin::is_memory(name))
            .collect();
        let n = own.len();
        let (inputs, outputs) = (&outline.inputs, &outline.outputs);
        // A black box's predicted outputs stand for its states already.
        let predicted: Vec<usize> = (0..outputs.len())
            .filter(|j| !own.contains(&outputs[*j].name))
            .collect();
        let names = predicted.iter().map(|j| &outputs[*j]);
        let more: Vec<String> = (inputs.iter().chain(names))
            .map(|q| q.name.clone())
            .collect();
        let mut bins = Self {
            cuts: vec![],
            variables: own.into_iter().chain(more).collect(),
            states: n,
            predicted,
        };
        for (record, r) in records.iter().enumerate() {
            for channel in 0..outputs.len() {
                bins.cuts.extend(windows(record, channel, r.samples()));
            }
        }
        let columns: Vec<Signal> = (states.iter().zip(records))
            .map(|((f, s), record)| bins.columns(f, s, record))
            .collect();
        for variable in 0..bins.variables.len() {
            let values: Vec<f64> = (columns.iter())
                .flat_map(|c| c.column(variable).to_vec())
                .collect();
            bins.cuts
                .extend(edges(&values).windows(2).map(|e| Cut::Region {
                    variable,
                    low: e[0],
                    high: e[1],
                }));
        }
        for channel in 0..outputs.len() {
            bins.cuts.push(Cut::Channel { channel });
            let past = (0..outputs.len())
                .map(Past::Output)
                .chain((0..inputs.len()).map(Past::Input));
            bins.cuts.extend(past.flat_map(|past| {
                THRESHOLDS.lag_bins.map(|(from, to)| Cut::Lag {
                    channel,
                    past,
                    from,
                    to,
                })
            }));
            bins.cuts
                .extend(THRESHOLDS.bands.windows(2).map(|e| Cut::Band {
                    channel,
                    low: e[0],
                    high: e[1],
                }));
        }
        bins
    }

    /// Variables that sort a sample: states and inputs a step before, since a sample tells about the step that led to
    /// it, and predicted outputs.
    pub fn columns(&self, filtered: &Filtered, states: &Signal, record: &Record) -> Signal {
        let drive = record.drive();
        let predicted = filtered.held_predictions(record.outputs());
        let inputs = drive.inputs().ncols();
        Signal::from_shape_fn((record.samples(), self.variables.len()), |(k, v)| {
            let before = k.saturating_sub(1);
            match v {
                v if v < self.states => states[[before, v]],
                v if v < self.states + inputs => drive.input(before)[v - self.states],
                v => predicted[[k, self.predicted[v - self.states - inputs]]],
            }
        })
    }

    /// The samples (record, row, channel) of windows and regions, handed to `f` as (cut, record, row, channel).
    pub fn visit(
        &self,
        states: &[(Filtered, Signal)],
        records: &[Record],
        mut f: impl FnMut(usize, usize, usize, usize),
    ) {
        let columns: Vec<Signal> = (states.iter().zip(records))
            .map(|((filtered, s), record)| self.columns(filtered, s, record))
            .collect();
        for (c, cut) in self.cuts.iter().enumerate() {
            match *cut {
                Cut::Window {
                    record,
                    channel,
                    from,
                    to,
                } => (from..to).for_each(|k| f(c, record, k, channel)),
                Cut::Region {
                    variable,
                    low,
                    high,
                } => {
                    for (r, values) in columns.iter().enumerate() {
                        for (k, value) in values.column(variable).iter().enumerate() {
                            if low <= *value && *value <= high {
                                (0..records[r].outputs().ncols()).for_each(|j| f(c, r, k, j));
                            }
                        }
                    }
                }
                Cut::Channel { .. } | Cut::Lag { .. } | Cut::Band { .. } => {}
            }
        }
    }
}

/// Ends of ranges with equal numbers of values.
pub(in crate::diagnose) fn edges(values: &[f64]) -> Vec<f64> {
    let mut edges: Vec<f64> = (0..=THRESHOLDS.bins)
        .filter_map(|i| quantile(values, i as f64 / THRESHOLDS.bins as f64).ok())
        .collect();
    edges.dedup();
    edges
}

/// Windows of a record, one sample each at least.
fn windows(record: usize, channel: usize, samples: usize) -> impl Iterator<Item = Cut> {
    let count = THRESHOLDS.windows.min(samples);
    (0..count).map(move |w| Cut::Window {
        record,
        channel,
        from: w * samples / count,
        to: (w + 1) * samples / count,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fewer samples than windows, too.
    #[test]
    fn windows_hold_each_sample_once() {
        for samples in 0..50 {
            let held: Vec<usize> = windows(0, 0, samples)
                .flat_map(|cut| match cut {
                    Cut::Window { from, to, .. } if from < to => from..to,
                    other => panic!("{samples} samples: {other:?}"),
                })
                .collect();
            assert_eq!(held, (0..samples).collect::<Vec<_>>());
        }
    }
}
