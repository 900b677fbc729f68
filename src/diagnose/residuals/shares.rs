//! Share of the misfit in each cut.

use super::cut::{Bins, Cut};
use super::excess::excess;
use crate::likelihood::kalman::Filtered;
use crate::record::{Record, Signal};

/// The share of each cut in its family: windows and regions in what an explanation gains, or else in what the innovations
/// exceed chance by, as outputs, lags and bands do. Losses count as nothing; each family adds up to at most one.
pub(in crate::diagnose) fn shares(
    bins: &Bins,
    states: &[(Filtered, Signal)],
    records: &[Record],
    after: Option<&[Filtered]>,
) -> Vec<f64> {
    let mut gains: Vec<f64> = (excess(states, records, bins).iter())
        .map(|e| e.square - e.expected)
        .collect();
    for (gain, cut) in gains.iter_mut().zip(&bins.cuts) {
        if in_samples(cut) {
            *gain = 0.0;
        }
    }
    bins.visit(states, records, |c, r, k, j| {
        let before = &states[r].0;
        gains[c] += match after {
            // A row's density is of all its channels.
            Some(after) => {
                let gain = after[r].log_densities[k] - before.log_densities[k];
                gain / records[r].outputs().ncols() as f64
            }
            None => 0.5 * (before.standardised[[k, j]].powi(2) - 1.0),
        };
    });
    let variables = bins.variables.len().max(1) as f64;
    let families: Vec<(u8, usize)> = bins.cuts.iter().map(family).collect();
    (families.iter().zip(&gains))
        .map(|(own, gain)| {
            let total: f64 = (families.iter().zip(&gains))
                .filter(|(f, _)| *f == own)
                .map(|(_, g)| g.max(0.0))
                .sum();
            let share = if total > 0.0 {
                gain.max(0.0) / total
            } else {
                0.0
            };
            // Every variable sorts the same samples: all of them together are the whole.
            match own.0 {
                REGIONS => share / variables,
                _ => share,
            }
        })
        .collect()
}

const REGIONS: u8 = 2;

fn family(cut: &Cut) -> (u8, usize) {
    match cut {
        Cut::Window { .. } => (0, 0),
        Cut::Region { variable, .. } => (REGIONS, *variable),
        Cut::Channel { .. } => (3, 0),
        Cut::Lag { .. } => (4, 0),
        Cut::Band { .. } => (5, 0),
    }
}

fn in_samples(cut: &Cut) -> bool {
    matches!(cut, Cut::Window { .. } | Cut::Region { .. })
}
