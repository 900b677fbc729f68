//! Means and covariances carried through the equations.
//!
//! Along each column L_j of the covariance's root, and along each noise, lie two points at ±√3 standard deviations:
//!
//! ```text
//! d_j = (f(m + √3·L_j) − f(m − √3·L_j)) / (2·√3)            slope
//! s_j = (f(m + √3·L_j) + f(m − √3·L_j)) / 2 − f(m)           bend
//! mean = f(m) + ⅓·Σ s_j,   covariance = Σ d_j d_jᵀ + (2/9)·Σ s_j s_jᵀ
//! ```
//!
//! This is the Gauss–Hermite rule with three points on each direction, the directions taken to add up: exact for f of
//! second degree without products (to third degree in the mean), never negative, and a direction that f does not
//! feel (a memory, say) changes nothing. The cubature rule lacks the last: its points move outwards with every
//! direction. Source: Nørgaard, Poulsen & Ravn, "New developments in state estimation for nonlinear systems",
//! *Automatica* 36 (2000), with h² = 3.

use super::Method;
use super::gaussian::{Gaussian, Root};
use crate::twin::{Advance, Interval, Now, StateSpace, Workspace};
use std::f64::consts::SQRT_2;

/// √3: points of the three-point Gauss–Hermite rule, in standard deviations.
const REACH: f64 = 1.732_050_807_568_877_2;
/// Step of a central difference, relative to the scale of what is varied.
const DIFFERENCE: f64 = 6e-6;

/// Buffers of one filter run: n states, p outputs.
pub(super) struct Moments<'a> {
    twin: &'a dyn StateSpace,
    method: Method,
    limits: &'a [(usize, Interval)],
    work: Workspace,
    /// The mean, one step on, before its noise.
    moved: Vec<f64>,
    /// Image of the mean.
    centre: Vec<f64>,
    /// Images of two points along each direction; later its slope and its bend, with P' = Σ D Dᵀ over both. Those
    /// of the root's columns first, then those of the noises.
    images: Vec<f64>,
    point: Vec<f64>,
    value: Vec<f64>,
    /// Jacobians, one column after the other.
    slopes: Vec<f64>,
}

/// Slopes and bends of states and outputs along each column of the root: Σ X Yᵀ is their covariance.
pub(super) struct Seen<'w> {
    pub states: &'w mut [f64],
    pub outputs: &'w mut [f64],
}

impl<'a> Moments<'a> {
    pub fn new(
        twin: &'a dyn StateSpace,
        method: Method,
        limits: &'a [(usize, Interval)],
        n: usize,
        p: usize,
    ) -> Self {
        Self {
            twin,
            method,
            limits,
            work: Workspace::new(n),
            moved: vec![0.0; n],
            centre: vec![0.0; n.max(p)],
            images: vec![0.0; 4 * n * n + 2 * n * p],
            point: vec![0.0; n],
            value: vec![0.0; n.max(p)],
            slopes: vec![0.0; n * n.max(p)],
        }
    }

    /// Mean and covariance after one step with process noise of standard deviation `q`, constraints included, limits not.
    ///
    /// Points are put into the limits before they move, since no real state is outside. The noise is added after the
    /// motion, so that the mean moves only once.
    #[inline(always)]
    pub fn predict(
        &mut self,
        n: usize,
        now: &Now<'_>,
        q: &[f64],
        mean: &[f64],
        root: &Root,
        next: &mut Gaussian,
    ) {
        let (twin, limits, q, mean) = (self.twin, self.limits, &q[..n], &mean[..n]);
        let noises = q.iter().filter(|q| **q != 0.0).count();
        let count = 2 * (root.rank() + noises);
        let (moved, centre) = (&mut self.moved[..n], &mut self.centre[..n]);
        moved.copy_from_slice(mean);
        hold(moved, limits);
        twin.advance(now, moved, &mut self.work);
        centre.copy_from_slice(moved);
        twin.constrain(now, centre);
        let (along, noisy) = self.images[..count * n].split_at_mut(2 * root.rank() * n);
        match self.method {
            Method::Points => {
                let work = &mut self.work;
                let pairs = along.chunks_exact_mut(2 * n);
                for (column, pair) in root.columns(n).zip(pairs) {
                    for (image, reach) in pair.chunks_exact_mut(n).zip([REACH, -REACH]) {
                        for ((to, m), l) in image.iter_mut().zip(mean).zip(column) {
                            *to = m + reach * l;
                        }
                        hold(image, limits);
                        twin.advance(now, image, work);
                        twin.constrain(now, image);
                    }
                }
            }
            Method::Extended => {
                let work = &mut self.work;
                let jacobian = Jacobian {
                    point: &mut self.point,
                    value: &mut self.value[..n],
                    slopes: &mut self.slopes,
                };
                jacobian.apply(mean, root, along, |x, next| {
                    next.copy_from_slice(x);
                    twin.advance(now, next, work);
                    twin.constrain(now, next);
                });
            }
        }
        let noises = q.iter().enumerate().filter(|(_, q)| **q != 0.0);
        for ((i, q), pair) in noises.zip(noisy.chunks_exact_mut(2 * n)) {
            let reach = match self.method {
                Method::Points => REACH * q,
                Method::Extended => DIFFERENCE * moved[i].abs().max(q.abs()),
            };
            for (image, sign) in pair.chunks_exact_mut(n).zip([1.0, -1.0]) {
                image.copy_from_slice(moved);
                image[i] += sign * reach;
                twin.constrain(now, image);
            }
            if self.method == Method::Extended {
                let distance = (moved[i] + reach) - (moved[i] - reach);
                let (plus, minus) = pair.split_at_mut(n);
                for (plus, minus) in plus.iter_mut().zip(minus) {
                    (*plus, *minus) = ((*plus - *minus) * q / distance, 0.0);
                }
            }
        }
        let mean = &mut next.mean[..n];
        mean.copy_from_slice(centre);
        let images = &mut self.images[..count * n];
        if self.method == Method::Points {
            differences(images, centre, mean);
        }
        outer(images, n, &mut next.cov);
    }

    /// cov(x_k, x_{k+1}) of the last [`predict`](Self::predict) from the same root (n × n, row-major).
    pub fn cross(&self, n: usize, root: &Root, cross: &mut [f64]) {
        cross.fill(0.0);
        for (column, pair) in root.columns(n).zip(self.images.chunks_exact(2 * n)) {
            let slopes = &pair[..n];
            for (i, l) in column.iter().enumerate() {
                for (to, slope) in cross[i * n..(i + 1) * n].iter_mut().zip(slopes) {
                    *to += l * slope;
                }
            }
        }
    }

    /// Mean of the outputs without noise, and slopes and bends of states and outputs.
    #[inline(always)]
    pub fn observe(
        &mut self,
        (n, p): (usize, usize),
        now: &Now<'_>,
        mean: &[f64],
        root: &Root,
        y: &mut [f64],
    ) -> Seen<'_> {
        let (mean, y, rank) = (&mean[..n], &mut y[..p], root.rank());
        let (states, outputs) = self.images.split_at_mut(2 * n * n);
        let (states, outputs) = (&mut states[..2 * rank * n], &mut outputs[..2 * rank * p]);
        self.twin.observe(now, mean, y);
        match self.method {
            Method::Points => {
                let point = &mut self.point[..n];
                let pairs = outputs.chunks_exact_mut(2 * p);
                for (column, pair) in root.columns(n).zip(pairs) {
                    for (image, reach) in pair.chunks_exact_mut(p).zip([REACH, -REACH]) {
                        for ((to, m), l) in point.iter_mut().zip(mean).zip(column) {
                            *to = m + reach * l;
                        }
                        self.twin.observe(now, point, image);
                    }
                }
                let centre = &mut self.centre[..p];
                centre.copy_from_slice(y);
                differences(outputs, centre, y);
            }
            Method::Extended => {
                let twin = self.twin;
                let jacobian = Jacobian {
                    point: &mut self.point,
                    value: &mut self.value[..p],
                    slopes: &mut self.slopes,
                };
                jacobian.apply(mean, root, outputs, |x, y| twin.observe(now, x, y));
            }
        }
        for (pair, column) in states.chunks_exact_mut(2 * n).zip(root.columns(n)) {
            pair[..n].copy_from_slice(column);
            pair[n..].fill(0.0);
        }
        Seen { states, outputs }
    }
}

/// Puts a point into the limits.
#[inline(always)]
fn hold(x: &mut [f64], limits: &[(usize, Interval)]) {
    for &(i, limit) in limits {
        x[i] = limit.clamp(x[i]);
    }
}

/// Buffers of central differences.
struct Jacobian<'w> {
    point: &'w mut [f64],
    value: &'w mut [f64],
    slopes: &'w mut [f64],
}

impl Jacobian<'_> {
    /// Slopes F·L_j, where F is the Jacobian of `f` at `mean`; no bends.
    fn apply(
        self,
        mean: &[f64],
        root: &Root,
        images: &mut [f64],
        mut f: impl FnMut(&[f64], &mut [f64]),
    ) {
        let (n, m) = (mean.len(), self.value.len());
        self.point.copy_from_slice(mean);
        for (i, slope) in self.slopes.chunks_exact_mut(m).take(n).enumerate() {
            slope.fill(0.0);
            let sd = root.columns(n).fold(0.0f64, |sum, l| sum.hypot(l[i]));
            if sd == 0.0 {
                continue;
            }
            let h = DIFFERENCE * mean[i].abs().max(sd);
            let (high, low) = (mean[i] + h, mean[i] - h);
            for (at, weight) in [(high, 1.0), (low, -1.0)] {
                self.point[i] = at;
                f(self.point, self.value);
                for (to, value) in slope.iter_mut().zip(self.value.iter()) {
                    *to += weight / (high - low) * value;
                }
            }
            self.point[i] = mean[i];
        }
        for (pair, column) in images.chunks_exact_mut(2 * m).zip(root.columns(n)) {
            let (plus, minus) = pair.split_at_mut(m);
            for (k, (plus, minus)) in plus.iter_mut().zip(minus).enumerate() {
                let sum: f64 = (0..n).map(|i| self.slopes[i * m + k] * column[i]).sum();
                (*plus, *minus) = (sum, 0.0);
            }
        }
    }
}

/// Makes slopes and bends of the images of two points, and adds to `mean` what the bends do to it.
#[inline(always)]
fn differences(images: &mut [f64], centre: &[f64], mean: &mut [f64]) {
    let m = centre.len();
    for pair in images.chunks_exact_mut(2 * m) {
        let (plus, minus) = pair.split_at_mut(m);
        for i in 0..m {
            let slope = (plus[i] - minus[i]) * (0.5 / REACH);
            let bend = 0.5 * (plus[i] + minus[i]) - centre[i];
            mean[i] += bend * (1.0 / 3.0);
            (plus[i], minus[i]) = (slope, bend * (SQRT_2 / 3.0));
        }
    }
}

/// Σ D Dᵀ, both triangles.
#[inline(always)]
pub(super) fn outer(deviations: &[f64], n: usize, sum: &mut [f64]) {
    let sum = &mut sum[..n * n];
    // A small sum stays in registers.
    let mut small = [0.0; 16];
    let lower = match n {
        ..=4 => &mut small[..n * n],
        _ => {
            sum.fill(0.0);
            &mut *sum
        }
    };
    for d in deviations.chunks_exact(n) {
        for i in 0..n {
            for j in 0..=i {
                lower[i * n + j] += d[i] * d[j];
            }
        }
    }
    if n <= 4 {
        sum.copy_from_slice(&small[..n * n]);
    }
    mirror(n, sum);
}

/// Copies the lower triangle to the upper one.
#[inline(always)]
pub(super) fn mirror(n: usize, matrix: &mut [f64]) {
    for i in 0..n {
        for j in 0..i {
            matrix[j * n + i] = matrix[i * n + j];
        }
    }
}
