//! Mean and covariance of an uncertain start.

use crate::likelihood::kalman::moments::REACH;
use crate::twin::{Composed, Now};

/// Adds the spread of the first state to `mean` and `cov` (n × n, zero); `false` where the start is known.
///
/// States that follow from others (memories of effects) are correlated with them: each uncertain state is moved by ±√3 standard
/// deviations, and what follows is set anew.
pub(in crate::likelihood::kalman) fn spread_start(
    twin: &Composed,
    now: &Now<'_>,
    mean: &mut [f64],
    cov: &mut [f64],
) -> bool {
    let n = mean.len();
    let mut std = vec![0.0; n];
    twin.start_deviation(now, &mut std);
    let centre = mean.to_vec();
    let moved = |i: usize, by: f64| {
        let mut x = centre.clone();
        x[i] += by;
        twin.begin(now, &mut x);
        x
    };
    for (i, std) in std.iter().enumerate().filter(|(_, std)| **std != 0.0) {
        let (plus, minus) = (moved(i, REACH * std), moved(i, -REACH * std));
        let slope: Vec<f64> = (plus.iter().zip(&minus))
            .map(|(p, m)| (p - m) / (2.0 * REACH))
            .collect();
        let bend: Vec<f64> = (plus.iter().zip(&minus).zip(&centre))
            .map(|((p, m), c)| 0.5 * (p + m) - c)
            .collect();
        for a in 0..n {
            mean[a] += bend[a] / 3.0;
            for b in 0..n {
                cov[a * n + b] += slope[a] * slope[b] + 2.0 / 9.0 * bend[a] * bend[b];
            }
        }
    }
    std.iter().any(|std| *std != 0.0)
}
