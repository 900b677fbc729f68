//! Filters side by side: up to eight pairs of parameters and record at once.
//!
//! Each number of the recursion is eight numbers ([`Lanes`]), one for each θ, which the processor handles together. The twin's equations stay
//! plain f64 and are called for one lane after the other.

use crate::likelihood::kalman::order::Order;
use crate::likelihood::kalman::pass::{FilterJob, Innovation, Pass, Sink};
use crate::likelihood::kalman::size::{Size, with_size};
use crate::likelihood::kalman::update::Readings;
use crate::likelihood::kalman::{FilterError, Kalman, Method, recoverable};
use crate::math::{Kernel, LANES, Lanes, wide};
use crate::twin::MOST_STATES;
use rayon::prelude::*;

/// So many filters take longer in lanes than one after the other: all lanes cost about two and a half of them.
const TOO_FEW: usize = 2;

/// Innovation and its variance, row by row; 0 and 1 where the output is missing.
pub(in crate::likelihood::kalman) type LaneRows = Vec<[Lanes; 2]>;

impl Sink<Lanes> for LaneRows {
    #[inline(always)]
    fn innovation(&mut self, _: usize, of: &Innovation<'_, Lanes>) {
        self.push([of.innovation[0], of.covariance[0]]);
    }
}

/// Rows of up to eight filters run side by side.
pub(in crate::likelihood::kalman) struct Together {
    /// Lane of each filter that was asked for.
    lanes: Vec<Option<usize>>,
    /// log p(y | θ) of each lane, in nats.
    pub log_likelihoods: Lanes,
    pub rows: LaneRows,
}

impl Together {
    /// Lane of the i-th filter; `None` where it failed or needs more than lanes offer, and is to be run alone.
    pub fn lane(&self, i: usize) -> Option<usize> {
        self.lanes[i].filter(|&lane| self.log_likelihoods.0[lane].is_finite())
    }

    /// log p(y | θ) of the i-th filter, where it has a [`lane`](Self::lane).
    fn log_likelihood(&self, i: usize) -> Option<f64> {
        self.lane(i).map(|lane| self.log_likelihoods.0[lane])
    }
}

impl Kalman<'_> {
    /// Returns whether lanes can hold this filter.
    fn fits_lanes(&self) -> bool {
        (1..=MOST_STATES).contains(&self.states)
            && self.channels == 1
            && self.settings.method == Method::Points
            && !self.twin.has_events()
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
        let alone = |theta: &Vec<f64>| recoverable(self.log_likelihood(theta));
        if !self.fits_lanes() {
            return thetas.par_iter().map(alone).collect();
        }
        let some = |thetas: &[Vec<f64>]| -> Result<Vec<Option<f64>>, FilterError> {
            let all: Vec<_> = thetas.iter().map(|theta| (self, &theta[..])).collect();
            let lanes = match all.len() {
                0..=TOO_FEW => None,
                _ => together(&all),
            };
            let of_lane = |i| lanes.as_ref().and_then(|lanes| lanes.log_likelihood(i));
            (thetas.iter().enumerate())
                .map(|(i, theta)| of_lane(i).map_or_else(|| alone(theta), |value| Ok(Some(value))))
                .collect()
        };
        let each: Vec<Vec<Option<f64>>> = thetas
            .par_chunks(LANES)
            .map(some)
            .collect::<Result<_, _>>()?;
        Ok(each.concat())
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

/// Runs up to eight filters that fit beside each other, each at a θ, side by side; `None` where all have to be run one by one.
pub(in crate::likelihood::kalman) fn together(all: &[(&Kalman<'_>, &[f64])]) -> Option<Together> {
    let (first, _) = all.first()?;
    if !first.fits_lanes() {
        return None;
    }
    let all = &all[..all.len().min(LANES)];
    let orders: Vec<Option<Order<'_>>> = (all.iter())
        .map(|&(kalman, theta)| {
            let order = Order::of(kalman, theta).ok()?;
            let is_plain = Readings::of(&kalman.twin, theta).is_none() && order.before == 0;
            is_plain.then_some(order)
        })
        .collect();
    let held: Vec<Option<FilterJob<'_>>> = (all.iter().zip(&orders))
        .map(|(&(kalman, theta), order)| {
            Some(FilterJob {
                kalman,
                order: order.as_ref()?,
                theta,
                acting: kalman.acting(theta).ok()?,
            })
        })
        .collect();
    let mut used = 0..LANES;
    let lanes = (held.iter())
        .map(|job| job.as_ref().and_then(|_| used.next()))
        .collect();
    let jobs: Vec<FilterJob<'_>> = held.into_iter().flatten().collect();
    if jobs.is_empty() {
        return None;
    }
    let mut rows = Vec::with_capacity(first.record.samples());
    let (jobs, to) = (&jobs[..], &mut rows);
    let log_likelihoods = with_size!(
        (first.states, first.channels),
        [1 2 3 4],
        |size| wide(SideBySide { size, jobs, to }).ok().flatten(),
        None
    )?;
    Some(Together {
        lanes,
        log_likelihoods,
        rows,
    })
}

/// A pass of several jobs; `None` where all fail.
struct SideBySide<'p, S> {
    size: S,
    jobs: &'p [FilterJob<'p>],
    to: &'p mut LaneRows,
}

impl<S: Size> Kernel for SideBySide<'_, S> {
    type Output = Option<Lanes>;

    #[inline(always)]
    fn run(self) -> Option<Lanes> {
        Pass::new(self.size, self.jobs).run(self.to).ok()
    }
}

#[cfg(test)]
mod tests;
