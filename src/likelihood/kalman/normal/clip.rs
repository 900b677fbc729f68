//! Mean and variance of a normal number that is held in an interval.

use super::tail::tail;
use crate::math::{Condition, Number};
use crate::twin::Interval;

/// Beyond this many standard deviations a limit is not felt: its share is below 2e-12.
const UNFELT: f64 = 7.0;

/// Holds each state in its interval; `scale` gets the factors of the covariances, if any limit is felt. Non-negative:
/// the result is D·P·D plus what the variances have more than that.
///
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
#[inline(always)]
pub(in crate::likelihood::kalman) fn clip<N: Number>(
    mean: &mut [N],
    cov: &mut [N],
    limits: &[Interval],
    scale: &mut [N],
) -> bool {
    let n = mean.len();
    let (cov, limits, scale) = (&mut cov[..n * n], &limits[..n], &mut scale[..n]);
    let mut any = false;
    for i in 0..n {
        let variance = cov[i * n + i];
        let (low, high) = (
            N::all(limits[i].low()) - mean[i],
            N::all(limits[i].high()) - mean[i],
        );
        let reach = variance * (UNFELT * UNFELT);
        let free_below = low.below(N::ZERO) & reach.below(low * low);
        let felt = !(free_below & N::ZERO.below(high) & reach.below(high * high));
        if !felt.any() {
            continue;
        }
        if !any {
            any = true;
            scale.fill(N::all(1.0));
        }
        let held = match N::LANES {
            1 => held_apart(mean[i], variance, felt, limits[i]),
            _ => held(mean[i], variance, felt, limits[i]),
        };
        scale[i] = held.inside;
        mean[i] = held.mean;
        for j in 0..n {
            cov[i * n + j] = cov[i * n + j] * held.inside;
            cov[j * n + i] = cov[j * n + i] * held.inside;
        }
        cov[i * n + i] = held.variance;
    }
    any
}

/// Mean, variance (at least Z²·s²) and Z, the share of x that is inside.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Clipped<N> {
    mean: N,
    variance: N,
    inside: N,
}

/// [`held`], out of the loops of one number.
#[inline(never)]
fn held_apart<N: Number>(mean: N, variance: N, felt: N::Condition, limit: Interval) -> Clipped<N> {
    held(mean, variance, felt, limit)
}

/// Moments of N(`mean`, `variance`) held in `limit`, where it is felt; elsewhere as they are.
#[inline(always)]
fn held<N: Number>(mean: N, variance: N, felt: N::Condition, limit: Interval) -> Clipped<N> {
    let (zero, one, unfelt) = (N::ZERO, N::all(1.0), N::all(UNFELT));
    let varies = felt & zero.below(variance);
    // Lanes that feel nothing, or do not vary, compute harmless numbers.
    let v = varies.select(variance, one);
    let sd = v.sqrt();
    let per_sd = sd.recip();
    let (low, high) = (
        (N::all(limit.low()) - mean) * per_sd,
        (N::all(limit.high()) - mean) * per_sd,
    );
    // An end that is not felt costs no special functions; an infinite end never is.
    let felt_low = varies & !unfelt.below(-low);
    let felt_high = varies & !unfelt.below(high);
    let (mut first, mut second, mut outside) = (zero, zero, zero);
    if felt_low.any() {
        let (share, density) = tail(felt_low.select(-low, unfelt));
        let low = felt_low.select(low, zero);
        first += felt_low.select(low * share + density, zero);
        second += felt_low.select(low * (low * share + density), zero);
        outside += felt_low.select(share, zero);
    }
    if felt_high.any() {
        let (share, density) = tail(felt_high.select(high, unfelt));
        let high = felt_high.select(high, zero);
        first += felt_high.select(high * share - density, zero);
        second += felt_high.select(high * (high * share - density), zero);
        outside += felt_high.select(share, zero);
    }
    let inside = (one - outside).max(zero);
    second += inside;
    let clamped = varies.select(mean + sd * first, mean);
    let clamped = N::all(limit.high()).min(N::all(limit.low()).max(clamped));
    // Chernoff's inequality, lost only to rounding.
    let spread = (second - first * first).max(inside * inside) * v;
    Clipped {
        mean: felt.select(clamped, mean),
        variance: felt.select(varies.select(spread, zero), variance),
        inside: varies.select(inside, one),
    }
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
                let weight = tail(z).1 * 20.0 / f64::from(steps);
                let (x, c) = (mean + sd * z, limit.clamp(mean + sd * z));
                for (sum, value) in sums.iter_mut().zip([1.0, c, c * c, c * (x - mean)]) {
                    *sum += weight * value;
                }
            }
            let [_, first, second, cross] = sums;
            let held = held(mean, sd * sd, true, limit);
            assert!((held.mean - first).abs() < 1e-6, "{held:?} {first}");
            assert!((held.variance - (second - first * first)).abs() < 1e-6);
            assert!((held.inside * sd * sd - cross).abs() < 1e-5);
        }
    }

    #[test]
    fn far_limits_are_not_felt_and_known_states_are_clamped() {
        let limit = Interval::new(0.0, 10.0).unwrap();
        assert!(!clip(&mut [5.0], &mut [0.4], &[limit], &mut [0.0]));
        let known = held(-3.0, 0.0, true, limit);
        assert_eq!((known.mean, known.variance), (0.0, 0.0));
        // So far outside that nothing of it is inside.
        let held = held(-50.0, 1.0, true, limit);
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
