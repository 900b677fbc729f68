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
    /// log p(y | θ) of each lane, in nats.
    pub log_likelihoods: Lanes,
    /// Innovation and its variance of each row.
    pub rows: Rows,
}

impl Kalman<'_> {
    /// Returns whether lanes can hold this filter.
    pub(super) fn fits_lanes(&self) -> bool {
        (1..=4).contains(&self.states)
            && self.channels == 1
            && self.settings.method == Method::Points
    }
}

/// Runs a filter at up to eight θ side by side; `None` where one of them fails or needs more than lanes offer, to be run one by one.
pub(super) fn together(kalman: &Kalman<'_>, thetas: &[&[f64]]) -> Option<Together> {
    if !kalman.fits_lanes() {
        return None;
    }
    let jobs: Vec<Job<'_>> = (thetas.iter())
        .map(|&theta| {
            let acting = kalman.acting(theta).ok()?;
            let plain =
                kalman.twin.outliers(theta).is_empty() && kalman.twin.rounding(theta).is_empty();
            plain.then_some(Job {
                kalman,
                theta,
                acting,
            })
        })
        .collect::<Option<_>>()?;
    let mut rows = Vec::with_capacity(kalman.record.samples());
    let (jobs, to) = (&jobs[..jobs.len().min(LANES)], &mut rows);
    let log_likelihoods = match kalman.states {
        1 => widest(Pass::<1, 5> { jobs, rows: to }),
        2 => widest(Pass::<2, 18> { jobs, rows: to }),
        3 => widest(Pass::<3, 39> { jobs, rows: to }),
        _ => widest(Pass::<4, 68> { jobs, rows: to }),
    }?;
    (log_likelihoods.0.iter().all(|v| v.is_finite())).then_some(Together {
        log_likelihoods,
        rows,
    })
}

#[cfg(test)]
mod tests;
