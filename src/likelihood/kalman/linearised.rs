//! Derivatives along the columns of a root, from central differences along the states.

use super::gaussian::Columns;

/// Step of a central difference, relative to the scale of what is varied.
const DIFFERENCE: f64 = 6e-6;

/// Step of a number with this value and standard deviation.
pub(super) fn step(value: f64, sd: f64) -> f64 {
    DIFFERENCE * value.abs().max(sd)
}

/// The mean, then two points for each state, a step up and a step down.
pub(super) fn points(mean: &[f64], root: Columns<'_>, points: &mut [f64]) {
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
pub(super) fn slopes(
    mean: &[f64],
    root: Columns<'_>,
    m: usize,
    images: &mut [f64],
    derivatives: &mut [f64],
) {
    let n = mean.len();
    let pairs = &mut images[m..];
    for (i, (pair, to)) in (pairs.chunks_exact(2 * m))
        .zip(derivatives.chunks_exact_mut(m))
        .enumerate()
    {
        let h = step(mean[i], deviation(root, n, i));
        // By the distance after rounding; a state that does not vary needs none.
        let distance = (mean[i] + h) - (mean[i] - h);
        let varies = deviation(root, n, i) > 0.0;
        for (k, to) in to.iter_mut().enumerate() {
            *to = match varies {
                true => (pair[k] - pair[m + k]) / distance,
                false => 0.0,
            };
        }
    }
    for (column, pair) in root.each(n).zip(pairs.chunks_exact_mut(2 * m)) {
        let (slope, bend) = pair.split_at_mut(m);
        bend.fill(0.0);
        for (k, slope) in slope.iter_mut().enumerate() {
            *slope = (0..n).map(|i| derivatives[i * m + k] * column[i]).sum();
        }
    }
}

/// Standard deviation of state i.
fn deviation(root: Columns<'_>, n: usize, i: usize) -> f64 {
    let square: f64 = root.each(n).map(|l| l[i] * l[i]).sum();
    square.sqrt()
}
