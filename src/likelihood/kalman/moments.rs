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

use super::gaussian::Columns;
use super::size::{Numbers, Size};
use super::{Method, linearised};
use crate::math::{Kernel, widest};
use crate::twin::{Interval, Layout, Now, Points, StateSpace, Workspace};
use std::f64::consts::SQRT_2;

/// √3: points of the three-point Gauss–Hermite rule, in standard deviations.
pub(super) const REACH: f64 = 1.732_050_807_568_877_2;
/// Slope of the difference of two points.
pub(super) const HALF_PER_REACH: f64 = 0.5 / REACH;
/// √2/3: weight of a bend in the covariance.
pub(super) const BEND: f64 = SQRT_2 / 3.0;

/// Up to so many states a sum of products keeps its entries in registers one by one.
const FEW: usize = 4;
/// Sizes that are known when this is compiled.
const KNOWN: usize = 10;

/// Buffers of one filter run: n states, p outputs.
pub(super) struct Moments<'a, S: Size> {
    size: S,
    twin: &'a dyn StateSpace,
    method: Method,
    limits: &'a [Interval],
    /// Limits of points that give a derivative.
    unlimited: Vec<Interval>,
    work: Workspace,
    /// Standard deviation of each noise, in the reach of its points.
    shifts: S::Vector,
    /// The mean, then two points for each direction (columns of the root, then noises); their images; then in the place of each
    /// pair its slope and its bend.
    points: S::Points,
    outputs: S::Points,
    derivatives: S::Matrix,
    /// The mean, for calls that would take it out of its registers.
    at: S::Vector,
}

impl<'a, S: Size> Moments<'a, S> {
    /// Creates the buffers; `limits` go by state.
    pub fn new(size: S, twin: &'a dyn StateSpace, method: Method, limits: &'a [Interval]) -> Self {
        let (n, p) = (size.states(), size.outputs());
        Self {
            size,
            twin,
            method,
            limits,
            unlimited: vec![Interval::EVERYTHING; n],
            work: Workspace::new(twin),
            shifts: S::Vector::zeros(n),
            points: S::Points::zeros((1 + 4 * n) * n),
            outputs: S::Points::zeros((1 + 2 * n) * p),
            derivatives: S::Matrix::zeros(n * n.max(p)),
            at: S::Vector::zeros(n),
        }
    }

    /// `mean` and `cov` after one step with process noise of standard deviation `q`, constraints included, limits not.
    ///
    /// Points are put into the limits before they move, since no real state is outside. The noise is added after the
    /// motion, so that the mean moves only once.
    #[inline(always)]
    pub fn predict(
        &mut self,
        now: &Now<'_>,
        q: &[f64],
        root: Columns<'_>,
        (mean, cov): (&mut [f64], &mut [f64]),
    ) {
        let n = self.size.states();
        let (mean, q, shifts) = (&mut mean[..n], &q[..n], &mut self.shifts.as_mut()[..n]);
        let pairs = match self.method {
            Method::Points => root.rank,
            Method::Extended => n,
        };
        let moving = 1 + 2 * pairs;
        let all = &mut self.points.as_mut()[..(moving + 2 * n) * n];
        match self.method {
            Method::Points => {
                spread(mean, root, &mut all[..moving * n]);
                for (shift, q) in shifts.iter_mut().zip(q) {
                    *shift = REACH * q;
                }
            }
            Method::Extended => {
                let at = &mut self.at.as_mut()[..n];
                for ((at, mean), limit) in at.iter_mut().zip(&*mean).zip(self.limits) {
                    *at = limit.clamp(*mean);
                }
                linearised::points(at, root, &mut all[..moving * n]);
                for ((shift, q), x) in shifts.iter_mut().zip(q).zip(&*mean) {
                    *shift = if *q == 0.0 {
                        0.0
                    } else {
                        linearised::step(*x, q.abs())
                    };
                }
            }
        }
        let points = Points {
            all,
            moving,
            limits: match self.method {
                Method::Points => self.limits,
                Method::Extended => &self.unlimited,
            },
            shifts,
        };
        let bent = self.twin.advance_each(now, points, &mut self.work);
        let all = &mut self.points.as_mut()[..(moving + 2 * n) * n];
        let (moving, shifted) = all.split_at_mut(moving * n);
        if self.method == Method::Extended {
            linearised::slopes(
                &self.at.as_ref()[..n],
                root,
                n,
                moving,
                self.derivatives.as_mut(),
            );
        }
        let (centre, pairs) = moving.split_at_mut(n);
        mean.copy_from_slice(centre);
        let pairs = &mut pairs[..2 * root.rank * n];
        if self.method == Method::Points {
            differences(pairs, centre, mean);
        }
        outer(pairs, n, cov);
        if bent {
            let pairs = (shifted.chunks_exact_mut(2 * n).zip(q.iter().zip(&*shifts)))
                .filter(|(_, (q, _))| **q != 0.0);
            for (pair, (q, shift)) in pairs {
                match self.method {
                    Method::Points => differences(pair, centre, mean),
                    Method::Extended => {
                        let (plus, minus) = pair.split_at_mut(n);
                        for (plus, minus) in plus.iter_mut().zip(minus) {
                            (*plus, *minus) = ((*plus - *minus) * (0.5 * q / shift), 0.0);
                        }
                    }
                }
                add_outer(pair, n, cov);
            }
        } else {
            // Straight: the slope is q along the state, the bend zero.
            for (i, q) in q.iter().enumerate() {
                cov[i * n + i] += q * q;
            }
        }
    }

    /// cov(x_k, x_{k+1}) of the last [`predict`](Self::predict) from the same root (n × n, row-major).
    pub fn cross(&self, root: Columns<'_>, cross: &mut [f64]) {
        let n = self.size.states();
        cross.fill(0.0);
        let pairs = self.points.as_ref()[n..].chunks_exact(2 * n);
        for (column, pair) in root.each(n).zip(pairs) {
            let slopes = &pair[..n];
            for (i, l) in column.iter().enumerate() {
                for (to, slope) in cross[i * n..(i + 1) * n].iter_mut().zip(slopes) {
                    *to += l * slope;
                }
            }
        }
    }

    /// Mean of the outputs without noise; returns their slope and bend along each column of the root.
    #[inline(always)]
    pub fn observe(
        &mut self,
        now: &Now<'_>,
        mean: &[f64],
        root: Columns<'_>,
        y: &mut [f64],
    ) -> &mut [f64] {
        let (n, p) = (self.size.states(), self.size.outputs());
        let (mean, y) = (&mean[..n], &mut y[..p]);
        let pairs = match self.method {
            Method::Points => root.rank,
            Method::Extended => n,
        };
        let points = &mut self.points.as_mut()[..(1 + 2 * pairs) * n];
        let outputs = &mut self.outputs.as_mut()[..(1 + 2 * pairs) * p];
        match self.method {
            Method::Points => spread(mean, root, points),
            Method::Extended => {
                let at = &mut self.at.as_mut()[..n];
                at.copy_from_slice(mean);
                linearised::points(at, root, points);
            }
        }
        (self.twin).observe_each(now, Layout::dense(n), p, points, outputs);
        if self.method == Method::Extended {
            linearised::slopes(
                &self.at.as_ref()[..n],
                root,
                p,
                outputs,
                self.derivatives.as_mut(),
            );
        }
        let (centre, pairs) = outputs.split_at_mut(p);
        y.copy_from_slice(centre);
        let pairs = &mut pairs[..2 * root.rank * p];
        if self.method == Method::Points {
            differences(pairs, centre, y);
        }
        pairs
    }
}

/// The mean, then two points on each column of the root.
#[inline(always)]
fn spread(mean: &[f64], root: Columns<'_>, points: &mut [f64]) {
    let n = mean.len();
    let (centre, pairs) = points.split_at_mut(n);
    centre.copy_from_slice(mean);
    for (column, pair) in root.each(n).zip(pairs.chunks_exact_mut(2 * n)) {
        let (plus, minus) = pair.split_at_mut(n);
        for i in 0..n {
            let away = REACH * column[i];
            (plus[i], minus[i]) = (mean[i] + away, mean[i] - away);
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
            let slope = (plus[i] - minus[i]) * HALF_PER_REACH;
            let bend = 0.5 * (plus[i] + minus[i]) - centre[i];
            mean[i] += bend * (1.0 / 3.0);
            (plus[i], minus[i]) = (slope, bend * BEND);
        }
    }
}

/// Σ D Dᵀ, both triangles.
#[inline(always)]
pub(super) fn outer(deviations: &[f64], n: usize, sum: &mut [f64]) {
    sum[..n * n].fill(0.0);
    add_outer(deviations, n, sum);
}

/// Adds Σ D Dᵀ, both triangles, to a symmetric matrix.
#[inline(always)]
pub(super) fn add_outer(deviations: &[f64], n: usize, sum: &mut [f64]) {
    let sum = &mut sum[..n * n];
    if n <= FEW {
        for i in 0..n {
            for j in 0..=i {
                let mut entry = sum[i * n + j];
                for d in deviations.chunks_exact(n) {
                    entry += d[i] * d[j];
                }
                (sum[i * n + j], sum[j * n + i]) = (entry, entry);
            }
        }
        return;
    }
    if n <= KNOWN {
        add_rows(deviations, n, sum);
    } else {
        widest(Rows { deviations, n, sum });
    }
}

/// As [`add_outer`], a row of the sum side by side; each entry adds up in the same order.
#[inline(always)]
fn add_rows(deviations: &[f64], n: usize, sum: &mut [f64]) {
    for (i, row) in sum.chunks_exact_mut(n).enumerate() {
        for d in deviations.chunks_exact(n) {
            let share = d[i];
            for (entry, d) in row.iter_mut().zip(d) {
                *entry += share * d;
            }
        }
    }
}

struct Rows<'w> {
    deviations: &'w [f64],
    n: usize,
    sum: &'w mut [f64],
}

impl Kernel for Rows<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        add_rows(self.deviations, self.n, self.sum);
    }
}
