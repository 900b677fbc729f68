//! Rates that jump, and errors that tell them from steep and from stiff ones.

use super::SubstepSchedule;
use crate::twin::integrator::pair;
use crate::twin::integrator::path::{Path, Stretch};
use crate::twin::integrator::rule::MOST_SUBSTEPS;
use nalgebra::DMatrix;

/// Lengths of two steps that tell rates that jump from those that are stiff, over the length that the tolerance allows: both are beyond it, and
/// not so far that all detail is lost.
pub(super) const JUMPS: [f64; 2] = [2.0, 16.0];
/// Least share of the largest error of a state at rest that each point has where time changes: gains of points may differ so much. Errors of points
/// that do not meet a jump are far below, those of points that do are alike.
const LEAST: f64 = 0.125;
/// Shares of a sample at which rates are compared with those at its begin, at uneven distances: what comes back to its place in between is seen.
const TIMES: [f64; 4] = [0.29, 0.61, 0.83, 1.0];
/// Difference that shows how fast rates change with a state, as a share of its size. A tenth or ten times show the same.
const NEAR: f64 = 1e-6;
/// Least number of steps of one length in a sample where rates jump again and again, as dry friction does: jumps are met within a step, all else has
/// its second order. Twice as many change the evidence of a sled with friction by 0.03 nats, and take twice the time.
const EVEN: usize = 4;

/// Steps of a sample that fail and that do not: where rates jump, several in a row fail each time that a point meets the jump.
#[derive(Debug, Default)]
pub(super) struct Falls {
    kept: usize,
    /// Kept steps that end where an explicit method is no longer stable.
    unstable: usize,
    /// Failures in a row, and rows of two behind the first kept step that are not by time.
    row: usize,
    pub rows: usize,
    /// Kept steps in a row.
    pub kept_in_row: usize,
}

impl Falls {
    /// Sees the end of a step; `is_by_time` tells whether it failed by what changes with time, which all points meet at once.
    pub fn see(&mut self, is_kept: bool, reach: f64, is_by_time: impl FnOnce() -> bool) {
        if is_kept {
            self.kept += 1;
            self.kept_in_row += 1;
            self.unstable += usize::from(reach > pair::STABLE);
            self.row = 0;
            return;
        }
        self.kept_in_row = 0;
        self.row += 1;
        self.rows += usize::from(self.row == 2 && self.kept > 0 && !is_by_time());
    }

    pub fn repeat(&self) -> bool {
        self.rows > 1
    }

    /// Returns whether the steps are short because rates are stiff.
    pub fn are_stiff(&self) -> bool {
        2 * self.unstable > self.kept
    }
}

impl SubstepSchedule {
    /// Returns whether a step from `x` fails by what changes with time: while the states stand, one of them still has an error beyond the tolerance,
    /// and each point has half of its own or more. Where each point meets a jump at its own time, some points have no error there once the step is
    /// short.
    pub(super) fn is_by_time(&mut self, path: &mut Path<'_, '_>, of: Stretch, x: &[f64]) -> bool {
        let x = self.with_followers(path, x);
        let (mut to, mut errors, mut at_rest) = (x.clone(), x.clone(), x.clone());
        self.step(path, of, &mut to, Some(&mut errors));
        path.limit_errors(of, &to, &mut errors);
        self.explicit.errors_at_rest(path, of, &x, &mut at_rest);
        path.limit_errors(of, &to, &mut at_rest);
        let shares = self.shares((&x, &to), &at_rest).enumerate();
        let worst = shares.max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((worst, _)) = worst.filter(|(_, share)| *share > 1.0) else {
            return false;
        };
        let (n, least) = (self.sizes.len(), LEAST * at_rest[worst].abs());
        let mut of_points = (at_rest.iter().zip(&errors)).skip(worst % n).step_by(n);
        of_points.all(|(at_rest, error)| at_rest.abs() >= least.max(0.5 * error.abs()))
    }

    /// Returns whether rates jump in steps of these lengths, beyond the tolerance: errors then grow in proportion to the length. Those of smooth rates
    /// grow with its fifth power, those of stiff rates faster. Those of what changes with time alone, a short pulse say, are no jump: all points meet it
    /// at one time, and shorter steps follow it.
    pub(super) fn jumps(
        &mut self,
        path: &mut Path<'_, '_>,
        x: &[f64],
        from: f64,
        lengths: [f64; 2],
    ) -> bool {
        let x = self.with_followers(path, x);
        // A jump that is told is none.
        let end = path.next_break(from) - from;
        let lengths = lengths.map(|length| length.min(end));
        let ways = lengths.map(|length| Stretch { from, length });
        let errors = ways.map(|of| {
            let (mut to, mut errors) = (x.clone(), x.clone());
            self.explicit.step(path, of, &mut to, Some(&mut errors));
            path.limit_errors(of, &to, &mut errors);
            self.largest((&x, &to), &errors)
        });
        let order = (errors[1] / errors[0]).ln() / (lengths[1] / lengths[0]).ln();
        errors[0] > 1.0
            && errors[1].is_finite()
            && order < 2.0
            && !ways.into_iter().any(|of| self.is_by_time(path, of, &x))
    }

    /// Least number of steps of one length: more where states have limits, which act at their ends, where rates change with time,
    /// and where rates are stiff. With a quarter of these a level that turns at its limit ends half a hundredth of its range off.
    /// Explicit steps are as short as the fastest state asks for.
    pub(super) fn even(&self, path: &mut Path<'_, '_>, x: &[f64]) -> usize {
        let way = Stretch {
            from: 0.0,
            length: 1.0,
        };
        let (has_limits, seconds) = (path.limits.is_some(), path.seconds(way));
        let mut at = |time: f64, x: &[f64]| {
            let mut rates = vec![0.0; x.len()];
            path.rates(way, time, x, &mut rates);
            rates
        };
        let first = at(0.0, x);
        // Jumps that move may be met anywhere on the way.
        let mut is_still = [0.0, 0.25, 0.5, 0.75, 1.0].into_iter().all(|share| {
            let ahead = x.iter().zip(&first);
            let ahead: Vec<f64> = ahead.map(|(x, rate)| x + share * seconds * rate).collect();
            let rates = at(0.0, &ahead);
            TIMES.into_iter().all(|time| at(time, &ahead) == rates)
        });
        let (n, sizes) = (self.sizes.len(), self.sizes_ahead(x, &first, seconds));
        let mut changes = vec![DMatrix::zeros(n, n); x.len() / n];
        for j in 0..n {
            let mut beside = |shares: f64| {
                let mut x = x.to_vec();
                let states = x.iter_mut().skip(j).step_by(n);
                states.for_each(|x| *x += shares * NEAR * sizes[j]);
                (at(0.0, &x), at(1.0, &x))
            };
            // A jump that moves leaves a point on one of its sides as it was.
            let [before, near, next] = [-1.0, 1.0, 2.0].map(&mut beside);
            is_still &= before.0 == before.1 && near.0 == near.1;
            let (near, next) = (near.0, next.0);
            for i in 0..x.len() {
                // A jump is in one change of both.
                let (one, other) = (near[i] - first[i], next[i] - near[i]);
                let change = if one.abs() < other.abs() { one } else { other };
                changes[i / n][(i % n, j)] = change / (NEAR * sizes[j]);
            }
        }
        let fastest = changes.into_iter().map(spectral_radius).fold(0.0, f64::max);
        let stable = match self.is_implicit {
            true => EVEN,
            false => (2.0 * fastest * seconds).ceil() as usize,
        };
        let least = match has_limits || self.is_implicit || !is_still {
            true => 8 * EVEN,
            false => EVEN,
        };
        stable.clamp(least, MOST_SUBSTEPS)
    }

    /// Sizes of the states, in the first sample those that the points and their rates show; what is zero has one that keeps its digits.
    fn sizes_ahead(&self, x: &[f64], rates: &[f64], seconds: f64) -> Vec<f64> {
        let mut sizes = self.sizes.clone();
        for (x, rates) in x.chunks(sizes.len()).zip(rates.chunks(sizes.len())) {
            for ((size, x), rate) in sizes.iter_mut().zip(x).zip(rates) {
                let ahead = x.abs().max((seconds * rate).abs());
                *size = size.max(ahead).max(f64::MIN_POSITIVE.sqrt());
            }
        }
        sizes
    }

    /// Returns all points, where the centre alone is carried and now at `x`: each is taken to be as far from it as where the way begins. Where `x` are
    /// all of them, they are within their limits.
    fn with_followers(&self, path: &Path<'_, '_>, x: &[f64]) -> Vec<f64> {
        let mut all = x.to_vec();
        for beside in self.beside.chunks_exact(x.len()) {
            all.extend(x.iter().zip(beside).map(|(x, beside)| x + beside));
        }
        path.limit(&mut all);
        all
    }

    /// Errors of a step over the tolerance of their states; there are none below the least number of full precision.
    fn shares(&self, (from, to): (&[f64], &[f64]), errors: &[f64]) -> impl Iterator<Item = f64> {
        let n = self.sizes.len();
        (errors.iter().zip(from).zip(to).enumerate()).map(move |(k, ((error, from), to))| {
            if error.abs() < f64::MIN_POSITIVE {
                return 0.0;
            }
            let size = self.sizes[k % n].max(from.abs()).max(to.abs());
            let share = error.abs() / (self.tolerance * size);
            if share.is_finite() {
                share
            } else {
                f64::INFINITY
            }
        })
    }

    /// Largest of the [`shares`](Self::shares) of all points.
    pub(super) fn largest(&self, points: (&[f64], &[f64]), errors: &[f64]) -> f64 {
        self.shares(points, errors).fold(0.0, f64::max)
    }
}

/// Spectral radius by ‖Jᵏ‖^(1/k) with k = 16 (Gelfand): above it by a few per cent where J is far from normal, as that of a position that follows a fast
/// speed; 0 where it has no numbers.
fn spectral_radius(mut matrix: DMatrix<f64>) -> f64 {
    let (mut log, mut power) = (0.0, 1.0);
    loop {
        let size = matrix.amax();
        if !(size > 0.0 && size.is_finite()) {
            return 0.0;
        }
        log += size.ln() / power;
        if power == 16.0 {
            return log.exp();
        }
        matrix /= size;
        matrix = &matrix * &matrix;
        power *= 2.0;
    }
}
