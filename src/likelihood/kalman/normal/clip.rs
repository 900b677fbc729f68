//! Mean and variance of a normal number that is held in an interval.

use super::tail::Tail;
use crate::twin::Interval;

/// Beyond this many standard deviations a limit is not felt: its share is below 2e-12.
pub(in crate::likelihood::kalman) const UNFELT: f64 = 7.0;

/// Moments of c = clamp(x, a, b), x ~ N(m, s²):
///
/// ```text
/// α = (a − m)/s,  β = (b − m)/s,  Z = Φ(β) − Φ(α)                   share inside
/// E c  = m + s·(α·Φ(α) + β·Φ(−β) + φ(α) − φ(β))
/// E (c − m)² = s²·(α²·Φ(α) + β²·Φ(−β) + Z + α·φ(α) − β·φ(β))
/// cov(c, y) = Z·cov(x, y)   for y jointly normal with x (Stein)
/// ```
///
/// Source: Stein's lemma; the rectified normal is in Socci, Lee & Seung, "The rectified Gaussian distribution" (1997).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::likelihood::kalman) struct Clipped {
    /// Mean.
    pub mean: f64,
    /// Variance; at least Z²·s².
    pub variance: f64,
    /// Z, the share of x that is inside.
    pub inside: f64,
}

/// Moments of N(`mean`, `variance`) held in `limit`; `None` where the limit is not felt.
#[inline(always)]
pub(in crate::likelihood::kalman) fn clipped(
    mean: f64,
    variance: f64,
    limit: Interval,
) -> Option<Clipped> {
    let (low, high) = (limit.low() - mean, limit.high() - mean);
    let reach = UNFELT * UNFELT * variance;
    if low < 0.0 && low * low > reach && high > 0.0 && high * high > reach {
        return None;
    }
    Some(held(mean, variance, limit))
}

fn held(mean: f64, variance: f64, limit: Interval) -> Clipped {
    if variance <= 0.0 {
        return Clipped {
            mean: limit.clamp(mean),
            variance: 0.0,
            inside: 1.0,
        };
    }
    let sd = variance.sqrt();
    let per_sd = 1.0 / sd;
    let (low, high) = (
        (limit.low() - mean) * per_sd,
        (limit.high() - mean) * per_sd,
    );
    // An end that is not felt costs no special functions.
    let end_of = |at: f64| match at > UNFELT {
        true => Tail::NONE,
        false => Tail::beyond(at),
    };
    let (below, above) = (end_of(-low), end_of(high));
    let inside = (1.0 - below.share - above.share).max(0.0);
    // c = m + s·clamp(z, α, β) for a standard normal z; infinite ends weigh nothing.
    let end = |at: f64, share: f64| if at.is_finite() { at * share } else { 0.0 };
    let first = end(low, below.share) + end(high, above.share) + below.density - above.density;
    let second = end(low, end(low, below.share) + below.density)
        + end(high, end(high, above.share) - above.density)
        + inside;
    Clipped {
        mean: limit.clamp(mean + sd * first),
        // Chernoff's inequality, lost only to rounding.
        variance: (second - first * first).max(inside * inside) * variance,
        inside,
    }
}

/// Holds each state in its interval; `scale` gets the factors of the covariances, if any limit is felt. Non-negative:
/// the result is D·P·D plus what the variances have more than that.
#[inline(always)]
pub(in crate::likelihood::kalman) fn clip(
    mean: &mut [f64],
    cov: &mut [f64],
    limits: &[Interval],
    scale: &mut [f64],
) -> bool {
    let n = mean.len();
    let (cov, limits, scale) = (&mut cov[..n * n], &limits[..n], &mut scale[..n]);
    let mut felt = false;
    for i in 0..n {
        let Some(held) = clipped(mean[i], cov[i * n + i], limits[i]) else {
            continue;
        };
        if !felt {
            felt = true;
            scale.fill(1.0);
        }
        scale[i] = held.inside;
        mean[i] = held.mean;
        for j in 0..n {
            cov[i * n + j] *= held.inside;
            cov[j * n + i] *= held.inside;
        }
        cov[i * n + i] = held.variance;
    }
    felt
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Noise;

    /// Against the trapezoidal rule on a fine grid.
    #[test]
    fn moments_are_the_integrals() {
        for (mean, sd, low, high) in [
            (0.3, 0.5, 0.0, f64::INFINITY),
            (-1.0, 0.4, 0.0, 10.0),
            (9.9, 0.2, f64::NEG_INFINITY, 10.0),
            (0.1, 3.0, -1.0, 1.5),
            (2.0, 0.1, 0.0, 2.0),
        ] {
            let limit = Interval::new(low, high).unwrap();
            let (steps, mut sums) = (400_000, [0.0f64; 4]);
            for k in 0..=steps {
                let z = -10.0 + 20.0 * f64::from(k) / f64::from(steps);
                let weight = Tail::beyond(z).density * 20.0 / f64::from(steps);
                let (x, c) = (mean + sd * z, limit.clamp(mean + sd * z));
                for (sum, value) in sums.iter_mut().zip([1.0, c, c * c, c * (x - mean)]) {
                    *sum += weight * value;
                }
            }
            let [_, first, second, cross] = sums;
            let held = clipped(mean, sd * sd, limit).unwrap();
            assert!((held.mean - first).abs() < 1e-6, "{held:?} {first}");
            assert!((held.variance - (second - first * first)).abs() < 1e-6);
            assert!((held.inside * sd * sd - cross).abs() < 1e-5);
        }
    }

    #[test]
    fn far_limits_are_not_felt_and_known_states_are_clamped() {
        let limit = Interval::new(0.0, 10.0).unwrap();
        assert_eq!(clipped(5.0, 0.4, limit), None);
        let held = clipped(-3.0, 0.0, limit).unwrap();
        assert_eq!((held.mean, held.variance), (0.0, 0.0));
        // So far outside that nothing of it is inside.
        let held = clipped(-50.0, 1.0, limit).unwrap();
        assert!(held.mean.abs() < 1e-12 && held.variance < 1e-12 && held.inside < 1e-12);
    }

    /// The clipped covariance stays a covariance, and matches draws where one state is limited.
    #[test]
    fn a_clipped_covariance_matches_draws() {
        let (mean, cov) = ([0.2, 1.0], [0.25, 0.3, 0.3, 1.0]);
        let (mut held, mut spread) = (mean, cov);
        let limits = [Interval::new(0.0, 10.0).unwrap(), Interval::EVERYTHING];
        assert!(clip(&mut held, &mut spread, &limits, &mut [0.0; 2]));
        let mut source = Noise::new(1, "clip", 0).source("z");
        let (n, mut sums) = (200_000, [0.0; 3]);
        for _ in 0..n {
            let (z1, z2) = (source.normal(), source.normal());
            let x1 = limits[0].clamp(0.2 + 0.5 * z1) - held[0];
            let x2 = 0.6 * z1 + 0.8 * z2;
            for (sum, value) in sums.iter_mut().zip([x1, x1 * x1, x1 * x2]) {
                *sum += value / f64::from(n);
            }
        }
        // Standard errors are below 1.1e-3.
        assert!(sums[0].abs() < 5e-3);
        assert!((sums[1] - spread[0]).abs() < 5e-3);
        assert!((sums[2] - spread[1]).abs() < 5e-3);
    }
}
