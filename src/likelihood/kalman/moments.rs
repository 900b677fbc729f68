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
use super::number::{Buffers, Call, FilterNumber};
use super::size::{Buffer, Size};
use super::{Kalman, Method, linearised};
use crate::math::{Condition, Kernel, Number, widest};
use crate::twin::{Composed, Interval, LanePlaces, Points};
use std::f64::consts::SQRT_2;

/// √3: points of the three-point Gauss–Hermite rule, in standard deviations.
pub(super) const REACH: f64 = 1.732_050_807_568_877_2;
/// Slope of the difference of two points.
const HALF_PER_REACH: f64 = 0.5 / REACH;
/// √2/3: weight of a bend in the covariance.
const BEND: f64 = SQRT_2 / 3.0;

/// Up to so many states a sum of products keeps its entries in registers one by one.
const FEW: usize = 4;
/// Up to so many states a sum of products goes row by row; more are faster in tiles.
const ROWS: usize = 10;

/// A state that is carried, as mean and covariance, n and n × n.
pub(super) type Moment<'w, N> = (&'w mut [N], &'w mut [N]);

/// Buffers of one filter run: n states, p outputs.
pub(super) struct Moments<'a, S: Size, N: FilterNumber> {
    size: S,
    twin: &'a Composed,
    method: Method,
    limits: &'a [Interval],
    /// Limits of points that give a derivative.
    unlimited: Vec<Interval>,
    buffers: Buffers,
    /// Standard deviation of each noise, in the reach of its points.
    shifts: S::Vector<N>,
    /// The mean, then two points for each direction (columns of the root, then noises); their images; then in the place of each
    /// pair its slope and its bend.
    points: Vec<N>,
    outputs: Vec<N>,
    derivatives: Vec<N>,
    /// The mean, for calls that would take it out of its registers.
    at: S::Vector<N>,
}

impl<'a, S: Size, N: FilterNumber> Moments<'a, S, N> {
    /// Creates the buffers for the twin, the method and the limits of `kalman`.
    pub fn new(size: S, kalman: &'a Kalman<'_>) -> Self {
        let (n, p) = (size.states(), size.outputs());
        Self {
            size,
            twin: &kalman.twin,
            method: kalman.settings.method,
            limits: &kalman.limits,
            unlimited: vec![Interval::EVERYTHING; n],
            buffers: Buffers::new(&kalman.twin, n),
            shifts: S::Vector::zeros(n),
            points: vec![N::ZERO; (1 + 4 * n) * n],
            outputs: vec![N::ZERO; (1 + 2 * n) * p],
            derivatives: vec![N::ZERO; n * n.max(p)],
            at: S::Vector::zeros(n),
        }
    }

    /// The method; lanes have points alone.
    #[inline(always)]
    fn method(&self) -> Method {
        match N::LANES {
            1 => self.method,
            _ => Method::Points,
        }
    }

    /// Returns what is wrong with points whose events have no end.
    pub fn fault(&self) -> Option<&str> {
        self.buffers.fault()
    }

    /// Pairs of points that the method needs along a root.
    #[inline(always)]
    fn pairs(&self, root: Columns<'_, N>) -> usize {
        match self.method() {
            Method::Points => root.rank,
            Method::Extended => self.size.states(),
        }
    }

    /// `mean` and `cov` after one step with process noise of standard deviation `q`, constraints included, limits not.
    ///
    /// Points are put into the limits before they move, since no real state is outside. The noise is added after the
    /// motion, so that the mean moves only once.
    #[inline(always)]
    pub fn predict(
        &mut self,
        now: &LanePlaces<'_>,
        q: &[N],
        root: Columns<'_, N>,
        (mean, cov): Moment<'_, N>,
    ) {
        let (n, method) = (self.size.states(), self.method());
        let moving = 1 + 2 * self.pairs(root);
        let (mean, q, shifts) = (&mut mean[..n], &q[..n], &mut self.shifts.numbers_mut()[..n]);
        let all = &mut self.points[..(moving + 2 * n) * n];
        match method {
            Method::Points => {
                spread(mean, root, &mut all[..moving * n]);
                for (shift, q) in shifts.iter_mut().zip(q) {
                    *shift = *q * REACH;
                }
            }
            Method::Extended => {
                let at = &mut self.at.numbers_mut()[..n];
                for ((at, mean), limit) in at.iter_mut().zip(&*mean).zip(self.limits) {
                    *at = N::all(limit.high()).min(N::all(limit.low()).max(*mean));
                }
                linearised::points(at, root, &mut all[..moving * n]);
                for ((shift, q), x) in shifts.iter_mut().zip(q).zip(&*mean) {
                    let some = varies(*q);
                    *shift = some.select(linearised::step(*x, q.abs()), N::ZERO);
                }
            }
        }
        let points = Points {
            all,
            moving,
            limits: match method {
                Method::Points => self.limits,
                Method::Extended => &self.unlimited,
            },
            shifts,
        };
        let call = Call {
            twin: self.twin,
            now,
            buffers: &mut self.buffers,
        };
        let bent = N::advance(call, points);
        let all = &mut self.points[..(moving + 2 * n) * n];
        let (moving, shifted) = all.split_at_mut(moving * n);
        if method == Method::Extended {
            let (at, derivatives) = (&self.at.numbers()[..n], &mut self.derivatives);
            linearised::slopes(at, root, n, moving, derivatives);
        }
        let (centre, pairs) = moving.split_at_mut(n);
        mean.copy_from_slice(centre);
        let pairs = &mut pairs[..2 * root.rank * n];
        if method == Method::Points {
            differences(pairs, centre, mean);
        }
        outer(pairs, n, cov);
        let any_bent = bent.any();
        for (i, pair) in shifted.chunks_exact_mut(2 * n).enumerate() {
            // A state without noise has no shifted points.
            let moved = bent & varies(q[i]);
            if !(any_bent && moved.any()) {
                // Straight: the slope is q along the state, the bend zero.
                cov[i * n + i] += q[i] * q[i];
                continue;
            }
            let (plus, minus) = pair.split_at_mut(n);
            for j in 0..n {
                let straight = if i == j { q[i] } else { N::ZERO };
                let difference = plus[j] - minus[j];
                let (slope, bend) = match method {
                    Method::Points => (
                        difference * HALF_PER_REACH,
                        (plus[j] + minus[j]) * 0.5 - centre[j],
                    ),
                    Method::Extended => (difference * (q[i] * 0.5 / shifts[i]), N::ZERO),
                };
                let bend = moved.select(bend, N::ZERO);
                mean[j] += bend * (1.0 / 3.0);
                (plus[j], minus[j]) = (moved.select(slope, straight), bend * BEND);
            }
            add_outer(pair, n, cov);
        }
    }

    /// cov(x_k, x_{k+1}) of the last [`predict`](Self::predict) from the same root (n × n, row-major).
    #[inline(always)]
    pub fn cross(&self, root: Columns<'_, N>, cross: &mut [N]) {
        let n = self.size.states();
        cross.fill(N::ZERO);
        let pairs = self.points[n..].chunks_exact(2 * n);
        for (column, pair) in root.each(n).zip(pairs) {
            let slopes = &pair[..n];
            for (i, l) in column.iter().enumerate() {
                for (to, slope) in cross[i * n..(i + 1) * n].iter_mut().zip(slopes) {
                    *to += *l * *slope;
                }
            }
        }
    }

    /// Mean of the outputs without noise; returns their slope and bend along each column of the root.
    #[inline(always)]
    pub fn observe(
        &mut self,
        now: &LanePlaces<'_>,
        mean: &[N],
        root: Columns<'_, N>,
        y: &mut [N],
    ) -> &mut [N] {
        let (n, p, method) = (self.size.states(), self.size.outputs(), self.method());
        let (mean, y) = (&mean[..n], &mut y[..p]);
        let pairs = self.pairs(root);
        let points = &mut self.points[..(1 + 2 * pairs) * n];
        let outputs = &mut self.outputs[..(1 + 2 * pairs) * p];
        match method {
            Method::Points => spread(mean, root, points),
            Method::Extended => {
                let at = &mut self.at.numbers_mut()[..n];
                at.copy_from_slice(mean);
                linearised::points(at, root, points);
            }
        }
        let call = Call {
            twin: self.twin,
            now,
            buffers: &mut self.buffers,
        };
        N::observe(call, n, points, outputs);
        if method == Method::Extended {
            let (at, derivatives) = (&self.at.numbers()[..n], &mut self.derivatives);
            linearised::slopes(at, root, p, outputs, derivatives);
        }
        let (centre, pairs) = outputs.split_at_mut(p);
        y.copy_from_slice(centre);
        let pairs = &mut pairs[..2 * root.rank * p];
        if method == Method::Points {
            differences(pairs, centre, y);
        }
        pairs
    }
}

/// Lanes with a noise.
#[inline(always)]
fn varies<N: Number>(q: N) -> N::Condition {
    q.below(N::ZERO) | N::ZERO.below(q)
}

/// The mean, then two points on each column of the root.
#[inline(always)]
fn spread<N: Number>(mean: &[N], root: Columns<'_, N>, points: &mut [N]) {
    let n = mean.len();
    let (centre, pairs) = points.split_at_mut(n);
    centre.copy_from_slice(mean);
    for (column, pair) in root.each(n).zip(pairs.chunks_exact_mut(2 * n)) {
        let (plus, minus) = pair.split_at_mut(n);
        for i in 0..n {
            let away = column[i] * REACH;
            (plus[i], minus[i]) = (mean[i] + away, mean[i] - away);
        }
    }
}

/// Makes slopes and bends of the images of two points, and adds to `mean` what the bends do to it.
#[inline(always)]
fn differences<N: Number>(images: &mut [N], centre: &[N], mean: &mut [N]) {
    let m = centre.len();
    for pair in images.chunks_exact_mut(2 * m) {
        let (plus, minus) = pair.split_at_mut(m);
        for i in 0..m {
            let slope = (plus[i] - minus[i]) * HALF_PER_REACH;
            let bend = (plus[i] + minus[i]) * 0.5 - centre[i];
            mean[i] += bend * (1.0 / 3.0);
            (plus[i], minus[i]) = (slope, bend * BEND);
        }
    }
}

/// Σ D Dᵀ, both triangles.
#[inline(always)]
pub(super) fn outer<N: Number>(deviations: &[N], n: usize, sum: &mut [N]) {
    sum[..n * n].fill(N::ZERO);
    add_outer(deviations, n, sum);
}

/// Adds Σ D Dᵀ, both triangles, to a symmetric matrix.
#[inline(always)]
pub(super) fn add_outer<N: Number>(deviations: &[N], n: usize, sum: &mut [N]) {
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
    if n <= ROWS {
        add_rows(deviations, n, sum);
    } else {
        widest(SumOfTiles { deviations, n, sum });
    }
}

/// As [`add_outer`], a row of the sum side by side; each entry adds up in the same order.
#[inline(always)]
fn add_rows<N: Number>(deviations: &[N], n: usize, sum: &mut [N]) {
    for (i, row) in sum.chunks_exact_mut(n).enumerate() {
        for d in deviations.chunks_exact(n) {
            let share = d[i];
            for (entry, d) in row.iter_mut().zip(d) {
                *entry += share * *d;
            }
        }
    }
}

/// Rows and columns of a tile, whose sums stay in the registers of the widest vectors while the deviations go by.
const TILE: (usize, usize) = (4, 8);

/// As [`add_rows`], tile by tile of the lower triangle.
struct SumOfTiles<'w, N> {
    deviations: &'w [N],
    n: usize,
    sum: &'w mut [N],
}

impl<N: Number> SumOfTiles<'_, N> {
    /// The tile of `R` rows from i on, and a tile's columns from j on.
    #[inline(always)]
    fn add_tile<const R: usize>(&mut self, i: usize, j: usize) {
        let n = self.n;
        let mut entries = [[N::ZERO; TILE.1]; R];
        for (r, entries) in entries.iter_mut().enumerate() {
            let from = (i + r) * n + j;
            entries.copy_from_slice(&self.sum[from..from + TILE.1]);
        }
        for d in self.deviations.chunks_exact(n) {
            let (down, across) = (&d[i..i + R], &d[j..j + TILE.1]);
            for (entries, down) in entries.iter_mut().zip(down) {
                for (entry, across) in entries.iter_mut().zip(across) {
                    *entry += *down * *across;
                }
            }
        }
        for (r, entries) in entries.iter().enumerate() {
            let to = (i + r) * n + j;
            self.sum[to..to + TILE.1].copy_from_slice(entries);
        }
    }
}

impl<N: Number> Kernel for SumOfTiles<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run(mut self) {
        let (n, (rows, columns)) = (self.n, TILE);
        let tiled = n - n % columns;
        for j in (0..tiled).step_by(columns) {
            // Above the diagonal a tile's entries are overwritten below.
            let end = n - (n - j) % rows;
            for i in (j..end).step_by(rows) {
                self.add_tile::<{ TILE.0 }>(i, j);
            }
            for i in end..n {
                self.add_tile::<1>(i, j);
            }
        }
        for i in tiled..n {
            for j in tiled..=i {
                let mut entry = self.sum[i * n + j];
                for d in self.deviations.chunks_exact(n) {
                    entry += d[i] * d[j];
                }
                self.sum[i * n + j] = entry;
            }
        }
        for i in 0..n {
            for j in 0..i {
                self.sum[j * n + i] = self.sum[i * n + j];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tiles add up in the order of rows, for sizes with and without what is left beside tiles.
    #[test]
    fn a_sum_of_products_has_the_same_bits_in_tiles() {
        for n in [11, 12, 16, 23, 40] {
            let deviations: Vec<f64> = (0..2 * n * n).map(|i| (i as f64 * 0.37).sin()).collect();
            let mut rows: Vec<f64> = (0..n * n).map(|i| ((i / n) * (i % n)) as f64).collect();
            let mut tiles = rows.clone();
            add_rows(&deviations, n, &mut rows);
            add_outer(&deviations, n, &mut tiles);
            assert_eq!(rows, tiles, "{n} states");
        }
    }
}
