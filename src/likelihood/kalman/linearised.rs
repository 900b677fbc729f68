//! Derivatives along the columns of a root, from central differences along the states.

use super::gaussian::Columns;
use crate::math::{Condition, Number};

/// Step of a central difference, relative to the scale of what is varied.
const DIFFERENCE: f64 = 6e-6;

/// Step of a number with this value and standard deviation.
#[inline(always)]
pub(super) fn step<N: Number>(value: N, sd: N) -> N {
    value.abs().max(sd) * DIFFERENCE
}

/// The mean, then two points for each state, a step up and a step down.
#[inline(always)]
pub(super) fn points<N: Number>(mean: &[N], root: Columns<'_, N>, points: &mut [N]) {
    let n = mean.len();
    let (centre, pairs) = points.split_at_mut(n);
    centre.copy_from_slice(mean);
    for (i, pair) in pairs.chunks_exact_mut(2 * n).enumerate() {
        let h = step(mean[i], deviation(root, n, i));
        for (x, h) in pair.chunks_exact_mut(n).zip([h, -h]) {
            x.copy_from_slice(mean);
            x[i] += h;
        }
    }
}

/// From images of [`points`] (m numbers each) the derivatives along the columns, in the places of the pairs; no bends.
#[inline(always)]
pub(super) fn slopes<N: Number>(
    mean: &[N],
    root: Columns<'_, N>,
    m: usize,
    images: &mut [N],
    derivatives: &mut [N],
) {
    let n = mean.len();
    let pairs = &mut images[m..];
    for (i, (pair, to)) in (pairs.chunks_exact(2 * m))
        .zip(derivatives.chunks_exact_mut(m))
        .enumerate()
    {
        let sd = deviation(root, n, i);
        let h = step(mean[i], sd);
        // By the distance after rounding; a state that does not vary needs none.
        let distance = (mean[i] + h) - (mean[i] - h);
        let varies = N::ZERO.below(sd);
        for (k, to) in to.iter_mut().enumerate() {
            *to = varies.select((pair[k] - pair[m + k]) / distance, N::ZERO);
        }
    }
    for (column, pair) in root.each(n).zip(pairs.chunks_exact_mut(2 * m)) {
        let (slope, bend) = pair.split_at_mut(m);
        bend.fill(N::ZERO);
        for (k, slope) in slope.iter_mut().enumerate() {
            let mut sum = N::ZERO;
            for i in 0..n {
                sum += derivatives[i * m + k] * column[i];
            }
            *slope = sum;
        }
    }
}

/// Standard deviation of state i.
#[inline(always)]
fn deviation<N: Number>(root: Columns<'_, N>, n: usize, i: usize) -> N {
    let mut square = N::ZERO;
    for column in root.each(n) {
        square += column[i] * column[i];
    }
    square.sqrt()
}
