//! Filters side by side: up to eight pairs of parameters and record at once.
//!
//! Each number of the recursion is eight numbers ([`Lanes`]), one for each θ, which the processor handles together. Equations in Rust stay
//! plain f64 and are called for one lane after the other; those of a text take all lanes in one call. Steps to a tolerance are those that the
//! first lane chooses.

use crate::likelihood::kalman::order::Order;
use crate::likelihood::kalman::pass::{AnyPass, FilterJob, Innovation, Pass, Sink};
use crate::likelihood::kalman::size::{Any, Size, with_size};
use crate::likelihood::kalman::update::Readings;
use crate::likelihood::kalman::{FilterError, Filtered, Kalman, Method, recoverable};
use crate::math::{Kernel, LANES, Lanes, is_wide, wide};
use crate::parallel::try_each;
use crate::twin::MOST_STATES;

/// So many filters take longer in lanes than one after the other: all lanes cost about two and a half of them.
const TOO_FEW: usize = 2;

/// Rows of several filters; innovations and variances are 0 and 1 where the output is missing.
#[derive(Default)]
pub(in crate::likelihood::kalman) struct LaneRows(pub Vec<LaneRow>);

/// One row of several filters.
#[derive(Clone, Copy)]
pub(in crate::likelihood::kalman) struct LaneRow {
    /// Innovation, its variance, and the nats by which the density exceeds that of a normal one.
    pub seen: [Lanes; 3],
    /// Innovation and variance as they would be of a signal with noise alone.
    pub plain: [Lanes; 2],
}

impl Sink<Lanes> for LaneRows {
    fn innovation(&mut self, _: usize, of: &Innovation<'_, Lanes>) {
        self.0.push(LaneRow {
            seen: [of.innovation[0], of.covariance[0], of.excess],
            plain: of.plain.map(|plain| plain[0]),
        });
    }
}

/// Up to eight filters that go side by side, each at a θ.
pub(in crate::likelihood::kalman) struct SideBySide<'k> {
    jobs: Vec<FilterJob<'k>>,
    /// Lane of each filter that was asked for; `None` where it needs more than lanes offer, and is to be run alone.
    lanes: Vec<Option<usize>>,
}

impl<'k> SideBySide<'k> {
    /// Filters that fit beside each other; `None` where all have to be run one by one.
    pub fn of(all: &[(&'k Kalman<'_>, &'k [f64])]) -> Option<Self> {
        let (first, _) = all.first()?;
        if !first.fits_lanes() {
            return None;
        }
        let mut jobs = Vec::with_capacity(LANES);
        let lanes: Vec<Option<usize>> = (all.iter().take(LANES))
            .map(|&(kalman, theta)| {
                let order = Order::of(kalman, theta).ok()?;
                let is_plain = Readings::of(&kalman.twin, theta).is_none() && order.is_plain();
                jobs.push(is_plain.then(|| kalman.job(&order, theta).ok())??);
                Some(jobs.len() - 1)
            })
            .collect();
        (!jobs.is_empty()).then_some(Self { jobs, lanes })
    }

    /// Their pass, before the first row.
    pub fn pass(&self) -> Box<dyn AnyPass<Lanes> + '_> {
        let jobs = &self.jobs[..];
        let any = Any {
            states: jobs[0].kalman.states,
            outputs: jobs[0].kalman.channels,
        };
        with_size!(
            (any.states, any.outputs),
            [1 2 3 4],
            |size| Box::new(Pass::new(size, jobs)),
            unreachable!("lanes hold few states: {any:?}")
        )
    }

    /// Lane of the i-th filter, where it has one.
    pub fn lane(&self, i: usize) -> Option<usize> {
        self.lanes[i]
    }

    /// log p(y | θ) of the i-th filter, of those of all lanes; `None` where it failed or has no lane.
    pub fn log_likelihood(&self, i: usize, of: &Lanes) -> Option<f64> {
        self.lane(i)
            .map(|lane| of.0[lane])
            .filter(|value| value.is_finite())
    }
}

impl<S: Size> AnyPass<Lanes> for Pass<'_, S, Lanes> {
    fn run_to(&mut self, end: usize, sink: &mut dyn Sink<Lanes>) -> Result<(), FilterError> {
        let pass = self;
        wide(Block { pass, end, sink }).unwrap_or_else(|_| unreachable!("filters fit no lanes"))
    }

    fn log_likelihood(&self) -> Lanes {
        Pass::log_likelihood(self)
    }
}

/// Rows of a pass before `end`.
struct Block<'p, 'k, S: Size> {
    pass: &'p mut Pass<'k, S, Lanes>,
    end: usize,
    sink: &'p mut dyn Sink<Lanes>,
}

impl<S: Size> Kernel for Block<'_, '_, S> {
    type Output = Result<(), FilterError>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        self.pass.run_to(self.end, self.sink)
    }
}

impl Kalman<'_> {
    /// Returns whether lanes can hold this filter.
    fn fits_lanes(&self) -> bool {
        (1..=MOST_STATES).contains(&self.states)
            && self.channels == 1
            && self.settings.method == Method::Points
            && !self.twin.has_events()
            && is_wide()
    }

    /// log p(y | θ) of several θ, in nats, on all cores; `None` where the filter does not work. Filters of few states run side by side.
    ///
    /// # Errors
    ///
    /// As [`log_likelihood`](Self::log_likelihood), where another θ would not help.
    pub(crate) fn log_likelihoods(
        &self,
        thetas: &[Vec<f64>],
    ) -> Result<Vec<Option<f64>>, FilterError> {
        let alone = |theta: &[f64]| self.log_likelihood(theta);
        self.beside_or_alone(thetas, alone, |held| {
            let mut pass = held.pass();
            pass.run_to(self.record.samples(), &mut ()).ok()?;
            let values = pass.log_likelihood();
            let lanes = 0..held.lanes.len();
            Some(lanes.map(|i| held.log_likelihood(i, &values)).collect())
        })
    }

    /// As [`log_likelihoods`](Self::log_likelihoods), with all that the filters saw but the states. Steps to a tolerance are each one's own.
    pub(crate) fn filter_all(
        &self,
        thetas: &[Vec<f64>],
    ) -> Result<Vec<Option<Filtered>>, FilterError> {
        let alone = |theta: &[f64]| self.filter(theta);
        if self.twin.workspace().steps_taken().is_some() {
            return try_each(thetas, |theta| recoverable(alone(theta)));
        }
        self.beside_or_alone(thetas, alone, |held| {
            let (mut pass, mut rows) = (held.pass(), LaneRows::default());
            pass.run_to(self.record.samples(), &mut rows).ok()?;
            let values = pass.log_likelihood();
            let filtered = |i| {
                let value = held.log_likelihood(i, &values)?;
                let lane = held.lane(i)?;
                let rows = (rows.0.iter()).map(|row| row.seen.map(|of| of.0[lane]));
                Some(Filtered::of_one_output(value, rows, self.record.outputs()))
            };
            Some((0..held.lanes.len()).map(filtered).collect())
        })
    }

    /// Finds something at several θ, on all cores: `together` has it of each filter that has a lane, where they can run side by side.
    fn beside_or_alone<T: Send>(
        &self,
        thetas: &[Vec<f64>],
        alone: impl Fn(&[f64]) -> Result<T, FilterError> + Sync,
        together: impl Fn(&SideBySide<'_>) -> Option<Vec<Option<T>>> + Sync,
    ) -> Result<Vec<Option<T>>, FilterError> {
        let alone = |theta: &Vec<f64>| recoverable(alone(theta));
        if !self.fits_lanes() {
            return try_each(thetas, alone);
        }
        let some = |thetas: &[Vec<f64>]| -> Result<Vec<Option<T>>, FilterError> {
            let all: Vec<_> = thetas.iter().map(|theta| (self, &theta[..])).collect();
            let found = match all.len() {
                0..=TOO_FEW => None,
                _ => SideBySide::of(&all).and_then(|held| together(&held)),
            };
            let mut found = found.into_iter().flatten();
            (thetas.iter())
                .map(|theta| match found.next().flatten() {
                    Some(value) => Ok(Some(value)),
                    None => alone(theta),
                })
                .collect()
        };
        let found = try_each(thetas.chunks(LANES), some)?;
        Ok(found.into_iter().flatten().collect())
    }

    /// Returns whether lanes can hold this filter beside another: of one twin that begins at the first row, with as many rows, the same ones
    /// missing, and no replicates.
    pub(in crate::likelihood::kalman) fn fits_beside(&self, other: &Self) -> bool {
        let is_same = std::ptr::eq(self, other);
        is_same
            || self.twin.is(&other.twin)
                && self.settings.method == other.settings.method
                && self.record.samples() == other.record.samples()
                && self.twin.begins().is_none()
                && [self, other].map(|k| k.record.drive().replicates()) == [0; 2]
                && !(self.gaps || other.gaps)
    }
}

#[cfg(test)]
mod tests;
