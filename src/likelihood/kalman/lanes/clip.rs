//! Limits on the states of all lanes; see the scalar form for the formulas.

use super::super::normal::clip::UNFELT;
use super::super::normal::tail::polynomial;
use crate::math::Lanes;
use crate::twin::Interval;
use std::f64::consts::FRAC_1_SQRT_2;

/// Holds each state in its interval.
#[inline(always)]
pub(super) fn clip<const N: usize>(
    mean: &mut [Lanes; N],
    cov: &mut [[Lanes; N]; N],
    limits: &[Interval],
) {
    let (zero, one, unfelt) = (Lanes::ZERO, Lanes::all(1.0), Lanes::all(UNFELT));
    for i in 0..N {
        let limit = limits[i];
        let (m, variance) = (mean[i], cov[i][i]);
        let (low, high) = (Lanes::all(limit.low()) - m, Lanes::all(limit.high()) - m);
        let reach = variance * (UNFELT * UNFELT);
        let free = (low.below(zero).and(reach.below(low * low)))
            .and(zero.below(high).and(reach.below(high * high)));
        let felt = free.not();
        if !felt.any() {
            continue;
        }
        let varies = felt.and(zero.below(variance));
        // Lanes that feel nothing, or do not vary, compute harmless numbers.
        let v = varies.select(variance, one);
        let sd = v.sqrt();
        let per_sd = sd.recip();
        let (low, high) = (low * per_sd, high * per_sd);
        // An end that no lane feels costs no special functions; an infinite end is felt by none.
        let (below, above) = (-low, high);
        let felt_low = varies.and(unfelt.below(below).not());
        let felt_high = varies.and(unfelt.below(above).not());
        let (mut first, mut second, mut outside) = (zero, zero, zero);
        if felt_low.any() {
            let (share, density) = tail(felt_low.select(below, unfelt));
            let low = felt_low.select(low, zero);
            first += felt_low.select(low * share + density, zero);
            second += felt_low.select(low * (low * share + density), zero);
            outside += felt_low.select(share, zero);
        }
        if felt_high.any() {
            let (share, density) = tail(felt_high.select(above, unfelt));
            let high = felt_high.select(high, zero);
            first += felt_high.select(high * share - density, zero);
            second += felt_high.select(high * (high * share - density), zero);
            outside += felt_high.select(share, zero);
        }
        let inside = (one - outside).max(zero);
        let second = second + inside;
        let hold = |x: Lanes| {
            let x = Lanes::all(limit.low()).max(x);
            Lanes::all(limit.high()).min(x)
        };
        let held = hold(varies.select(m + sd * first, m));
        let spread = (second - first * first).max(inside * inside) * v;
        let inside = varies.select(inside, one);
        mean[i] = felt.select(held, m);
        for j in 0..N {
            cov[i][j] = cov[i][j] * inside;
            cov[j][i] = cov[j][i] * inside;
        }
        cov[i][i] = felt.select(varies.select(spread, zero), variance);
    }
}

/// Φ(−z) and φ(z).
#[inline(always)]
fn tail(z: Lanes) -> (Lanes, Lanes) {
    let scale = (z * z * -0.5).exp();
    let x = (z.abs() * FRAC_1_SQRT_2).min(Lanes::all(5.0));
    let s = Lanes::all(2.2) - Lanes::all(9.6) / (x + 3.0);
    let mut p = Lanes::ZERO;
    for (p, s) in p.0.iter_mut().zip(s.0) {
        *p = polynomial(s);
    }
    let half = scale * 0.5 * p / (x * 2.0 + 1.0);
    let share = z.below(Lanes::ZERO).select(Lanes::all(1.0) - half, half);
    (share, scale * super::super::normal::tail::DENSITY)
}
