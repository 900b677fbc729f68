//! The filter at eight parameters at once.
//!
//! Each number of the recursion is eight numbers side by side ([`Lanes`]), one for each θ, which the processor handles
//! together. The twin's equations stay plain f64 and are called for one lane after the other.

#![allow(clippy::needless_range_loop)] // indices, as in the formulas

mod clip;
mod pass;

use super::{Kalman, Method};
use crate::math::{LANES, Lanes, widest};
use pass::{Job, Pass, Rows};

/// Rows of up to eight filters run side by side.
pub(super) struct Together {
    /// Lane of each filter that was asked for.
    lanes: Vec<Option<usize>>,
    /// log p(y | θ) of each lane, in nats.
    pub log_likelihoods: Lanes,
    /// Innovation and its variance of each row.
    pub rows: Rows,
}

impl Together {
    /// Lane of the i-th filter; `None` where it failed or needs more than lanes offer, and is to be run alone.
    pub fn lane(&self, i: usize) -> Option<usize> {
        self.lanes[i].filter(|&lane| self.log_likelihoods.0[lane].is_finite())
    }
}

impl Kalman<'_> {
    /// Returns whether lanes can hold this filter.
    fn fits_lanes(&self) -> bool {
        (1..=4).contains(&self.states)
            && self.channels == 1
            && self.settings.method == Method::Points
    }

    /// Returns whether lanes can hold this filter beside another: of one twin, with as many rows, and the same ones missing.
    pub(super) fn fits_beside(&self, other: &Self) -> bool {
        let is_same = std::ptr::eq(self, other);
        is_same
            || std::ptr::addr_eq(self.twin, other.twin)
                && self.settings.method == other.settings.method
                && self.record.samples() == other.record.samples()
                && !(self.gaps || other.gaps)
    }
}

/// Runs up to eight filters that fit beside each other, each at a θ, side by side; `None` where all have to be run one by one.
pub(super) fn together(all: &[(&Kalman<'_>, &[f64])]) -> Option<Together> {
    let (first, _) = all.first()?;
    if !first.fits_lanes() {
        return None;
    }
    let all = &all[..all.len().min(LANES)];
    let held: Vec<Option<Job<'_>>> = (all.iter())
        .map(|&(kalman, theta)| {
            let acting = kalman.acting(theta).ok()?;
            let dead_time = (kalman.twin).dead_time(theta, kalman.record.drive().dt());
            let plain = (kalman.twin.outliers(theta).is_empty())
                && kalman.twin.rounding(theta).is_empty()
                && dead_time.is_empty();
            plain.then_some(Job {
                kalman,
                theta,
                acting,
            })
        })
        .collect();
    let mut used = 0..LANES;
    let lanes = (held.iter())
        .map(|job| job.as_ref().and_then(|_| used.next()))
        .collect();
    let jobs: Vec<Job<'_>> = held.into_iter().flatten().collect();
    if jobs.is_empty() {
        return None;
    }
    let mut rows = Vec::with_capacity(first.record.samples());
    let (jobs, to) = (&jobs[..], &mut rows);
    let log_likelihoods = match first.states {
        1 => widest(Pass::<1, 5> { jobs, rows: to }),
        2 => widest(Pass::<2, 18> { jobs, rows: to }),
        3 => widest(Pass::<3, 39> { jobs, rows: to }),
        _ => widest(Pass::<4, 68> { jobs, rows: to }),
    }?;
    Some(Together {
        lanes,
        log_likelihoods,
        rows,
    })
}

#[cfg(test)]
mod tests;
