//! Where in time, and at which states and inputs, the twin does not follow.

use crate::filter::Filtered;
use crate::math::quantile;
use crate::twin::{Outline, Record, Signal};

/// Windows of a record.
const WINDOWS: usize = 8;
/// Bins of a variable, of equal numbers of samples.
const BINS: usize = 5;

/// A stretch of time, or a range of a variable.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Cell {
    Window {
        record: usize,
        channel: usize,
        from: usize,
        to: usize,
    },
    /// Of a state, or of an input behind the states.
    Region {
        variable: usize,
        low: f64,
        high: f64,
    },
}

/// Cells that a record and its simulations are cut into.
#[derive(Debug, Clone)]
pub(super) struct Bins {
    pub cells: Vec<Cell>,
    /// Names of states and inputs.
    pub variables: Vec<String>,
    /// How many of them are states.
    pub states: usize,
}

impl Bins {
    /// Of filtered states and records.
    pub fn new(outline: &Outline, states: &[(Filtered, Signal)], records: &[Record]) -> Self {
        let own: Vec<String> = (outline.states.iter())
            .map(|s| s.name.clone())
            .take_while(|name| !name.contains('/'))
            .collect();
        let n = own.len();
        let variables: Vec<String> = (own.into_iter())
            .chain(outline.inputs.iter().map(|u| u.name.clone()))
            .collect();
        let mut cells = Vec::new();
        for (r, record) in records.iter().enumerate() {
            let samples = record.samples();
            for channel in 0..outline.outputs.len() {
                cells.extend((0..WINDOWS).map(|w| Cell::Window {
                    record: r,
                    channel,
                    from: w * samples / WINDOWS,
                    to: (w + 1) * samples / WINDOWS,
                }));
            }
        }
        let mut bins = Self {
            cells: vec![],
            variables,
            states: n,
        };
        for variable in 0..bins.variables.len() {
            let values: Vec<f64> = (states.iter().zip(records))
                .flat_map(|((_, s), record)| {
                    (0..record.samples()).map(|k| bins.value(variable, s, record, k))
                })
                .collect();
            let mut edges: Vec<f64> = (0..=BINS)
                .filter_map(|i| quantile(&values, i as f64 / BINS as f64).ok())
                .collect();
            edges.dedup();
            cells.extend(edges.windows(2).map(|e| Cell::Region {
                variable,
                low: e[0],
                high: e[1],
            }));
        }
        bins.cells = cells;
        bins
    }

    fn value(&self, variable: usize, states: &Signal, record: &Record, k: usize) -> f64 {
        if variable < self.states {
            states[[k, variable]]
        } else {
            record.drive().input(k)[variable - self.states]
        }
    }

    /// Which samples (record, row, channel) belong to each cell, each handed to `f` as (cell, record, row, channel).
    pub fn visit(
        &self,
        states: &[Signal],
        records: &[Record],
        mut f: impl FnMut(usize, usize, usize, usize),
    ) {
        for (c, cell) in self.cells.iter().enumerate() {
            match *cell {
                Cell::Window {
                    record,
                    channel,
                    from,
                    to,
                } => (from..to).for_each(|k| f(c, record, k, channel)),
                Cell::Region {
                    variable,
                    low,
                    high,
                } => {
                    for (r, record) in records.iter().enumerate() {
                        for k in 0..record.samples() {
                            // What a sample says is about the step that led to it.
                            let value =
                                self.value(variable, &states[r], record, k.saturating_sub(1));
                            if low <= value && value <= high {
                                (0..record.outputs().ncols()).for_each(|j| f(c, r, k, j));
                            }
                        }
                    }
                }
            }
        }
    }
}

/// How little each cell's innovations look like N(0, 1): √(n·mean² + n/2·(mean square − 1)²).
pub(super) fn local(states: &[(Filtered, Signal)], records: &[Record], bins: &Bins) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0, 0.0); bins.cells.len()];
    let means: Vec<Signal> = states.iter().map(|(_, s)| s.clone()).collect();
    bins.visit(&means, records, |c, r, k, j| {
        let v = states[r].0.standardised[[k, j]];
        let (n, sum, square) = &mut sums[c];
        *n += 1.0;
        *sum += v;
        *square += v * v;
    });
    sums.into_iter()
        .map(|(n, sum, square)| {
            if n < 5.0 {
                return 0.0;
            }
            (sum * sum / n + 0.5 * n * (square / n - 1.0).powi(2)).sqrt()
        })
        .collect()
}

/// Share of each cell in what an explanation gains: its gain over the sum of gains of its family, losses left out.
pub(super) fn shares(
    bins: &Bins,
    states: &[Signal],
    records: &[Record],
    before: &[Filtered],
    after: Option<&[Filtered]>,
) -> Vec<f64> {
    let mut gains = vec![0.0; bins.cells.len()];
    bins.visit(states, records, |c, r, k, j| {
        gains[c] += match after {
            // A row's density is of all its channels.
            Some(after) => {
                (after[r].log_densities[k] - before[r].log_densities[k])
                    / records[r].outputs().ncols() as f64
            }
            None => 0.5 * (before[r].standardised[[k, j]].powi(2) - 1.0),
        };
    });
    let family = |cell: &Cell| match cell {
        Cell::Window { .. } => usize::MAX,
        Cell::Region { variable, .. } => *variable,
    };
    let families: Vec<usize> = bins.cells.iter().map(family).collect();
    (families.iter().zip(&gains))
        .map(|(own, gain)| {
            let total: f64 = (families.iter().zip(&gains))
                .filter(|(f, _)| *f == own)
                .map(|(_, g)| g.max(0.0))
                .sum();
            if total > 0.0 {
                gain.max(0.0) / total
            } else {
                0.0
            }
        })
        .collect()
}
