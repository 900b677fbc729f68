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
            Some(after) => channel_gain(before, &after[r], k, j),
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

/// Part of a row's gain in log density that is a channel's: its own squares, and an equal share of what variances do.
fn channel_gain(before: &Filtered, after: &Filtered, row: usize, channel: usize) -> f64 {
    let whole = after.log_densities[row] - before.log_densities[row];
    let (old, new) = (before.standardised.row(row), after.standardised.row(row));
    let squares = (&old * &old - &new * &new) * 0.5;
    squares[channel] + (whole - squares.sum()) / squares.len() as f64
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

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array3, array};

    /// A channel that an explanation mends gains what the row does.
    #[test]
    fn the_gain_is_that_of_the_channel_that_fits_better() {
        let at = |second: f64, log_density: f64| Filtered {
            log_likelihood: log_density,
            log_densities: vec![log_density],
            innovations: Signal::zeros((1, 2)),
            covariances: Array3::zeros((1, 2, 2)),
            standardised: array![[0.5, second]],
            states: None,
        };
        let (before, after) = (at(10.0, -52.0), at(0.0, -2.0));
        let gains = [0, 1].map(|channel| channel_gain(&before, &after, 0, channel));
        assert_eq!(gains, [0.0, 50.0]);
    }
}
