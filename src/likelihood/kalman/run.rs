//! Runs of a filter at one θ, or at several side by side.

mod beside;
mod start;

use super::normal::clip::clip;
use super::order::Order;
use super::pass::{AnyPass, FilterJob, Pass, Sink};
use super::size::{Any, with_size};
use super::{FilterError, Kalman};
use crate::twin::{Acting, Now};

pub(super) use beside::{LaneRows, SideBySide};
pub(super) use start::spread_start;

impl Kalman<'_> {
    /// The record's drive as the twin sees it at θ, which is checked.
    pub(super) fn acting(&self, theta: &[f64]) -> Result<Acting<'_>, FilterError> {
        let drive = self.record.drive();
        self.check(theta)?;
        self.twin.check_parameters(theta, drive.dt())?;
        Ok(Acting::of(&self.twin, theta, drive)?)
    }

    /// The first state; `cov` comes zeroed.
    pub(super) fn start(
        &self,
        now: &Now<'_>,
        mean: &mut [f64],
        cov: &mut [f64],
        scale: &mut [f64],
    ) {
        self.twin.start(now, mean);
        match &self.start_covariance {
            Some(covariance) => cov.copy_from_slice(covariance),
            None if !spread_start(&self.twin, now, mean, cov) => return,
            None => {}
        }
        clip(mean, cov, &self.limits, scale);
    }

    /// log p(y | θ), in nats.
    ///
    /// # Errors
    ///
    /// [`FilterError`]: θ of another length, a twin that refuses it, a filter that diverged or has no spread.
    pub fn log_likelihood(&self, theta: &[f64]) -> Result<f64, FilterError> {
        self.run(theta, &mut ())
    }

    /// One pass over the record; the log-likelihood.
    pub(super) fn run(&self, theta: &[f64], sink: &mut dyn Sink) -> Result<f64, FilterError> {
        self.run_in(&Order::of(self, theta)?, theta, sink)
    }

    /// As [`run`](Self::run), the rows in this order.
    pub(super) fn run_in(
        &self,
        order: &Order<'_>,
        theta: &[f64],
        sink: &mut dyn Sink,
    ) -> Result<f64, FilterError> {
        let job = &[self.job(order, theta)?];
        let mut pass = self.pass(job);
        let run = pass.run_to(order.rows(), sink);
        run.map_err(|error| self.reason_of(error, theta))?;
        Ok(pass.log_likelihood())
    }

    /// The pass of a job of this filter, before its first row. It is compiled once for all sinks, whose calls are few beside a row's work.
    pub(super) fn pass<'j>(&self, job: &'j [FilterJob<'j>; 1]) -> Box<dyn AnyPass<f64> + 'j> {
        let (states, outputs) = (self.states, self.channels);
        with_size!(
            (states, outputs),
            [1 2 3 4 5 6 7 8 9 10],
            |size| Box::new(Pass::new(size, job)),
            Box::new(Pass::new(Any { states, outputs }, job))
        )
    }

    /// Returns what the twin says of the last run at θ, or else the error.
    pub(super) fn reason_of(&self, error: FilterError, theta: &[f64]) -> FilterError {
        self.twin.fault(theta).map_or(error, Into::into)
    }

    /// This filter at θ, the rows in this order.
    pub(super) fn job<'j>(
        &'j self,
        order: &Order<'j>,
        theta: &'j [f64],
    ) -> Result<FilterJob<'j>, FilterError> {
        Ok(FilterJob {
            kalman: self,
            order: order.clone(),
            theta,
            acting: self.acting(theta)?,
        })
    }
}
