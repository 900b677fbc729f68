//! Runs of a filter at one θ.

use super::order::Order;
use super::pass::{Bound, Pass, Sink};
use super::size::{Any, Fixed};
use super::start::spread_start;
use super::{FilterError, Kalman};
use crate::twin::{Acting, Now};

impl Kalman<'_> {
    /// The record's drive as the twin sees it at θ, which is checked.
    pub(super) fn acting(&self, theta: &[f64]) -> Result<Acting<'_>, FilterError> {
        let drive = self.record.drive();
        self.check(theta)?;
        self.twin.check_parameters(theta, drive.dt())?;
        Ok(Acting::of(self.twin, theta, drive)?)
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
            None if !spread_start(self.twin, now, mean, cov) => return,
            None => {}
        }
        self.hold(mean, cov, scale);
    }

    /// log p(y | θ), in nats.
    ///
    /// # Errors
    ///
    /// [`FilterError`]: θ of another length, a twin that refuses it, a filter that diverged or has no spread.
    pub fn log_likelihood(&self, theta: &[f64]) -> Result<f64, FilterError> {
        self.run_into(theta, &mut ())
    }

    /// One pass over the record; the log-likelihood. The pass is compiled once for all sinks.
    pub(super) fn run(&self, theta: &[f64], sink: &mut dyn Sink) -> Result<f64, FilterError> {
        self.run_into(theta, sink)
    }

    fn run_into<K: Sink + ?Sized>(&self, theta: &[f64], sink: &mut K) -> Result<f64, FilterError> {
        self.run_in(&Order::of(self, theta)?, theta, sink)
    }

    /// As [`run`](Self::run), the rows in this order.
    pub(super) fn run_in<K: Sink + ?Sized>(
        &self,
        order: &Order<'_>,
        theta: &[f64],
        sink: &mut K,
    ) -> Result<f64, FilterError> {
        let acting = self.acting(theta)?;
        let on = &Bound {
            kalman: self,
            acting: &acting,
            order,
            theta,
        };
        match (self.states, self.channels) {
            (1, 1) => Pass::new(Fixed::<1>, on).run(sink),
            (2, 1) => Pass::new(Fixed::<2>, on).run(sink),
            (3, 1) => Pass::new(Fixed::<3>, on).run(sink),
            (4, 1) => Pass::new(Fixed::<4>, on).run(sink),
            (5, 1) => Pass::new(Fixed::<5>, on).run(sink),
            (6, 1) => Pass::new(Fixed::<6>, on).run(sink),
            (7, 1) => Pass::new(Fixed::<7>, on).run(sink),
            (8, 1) => Pass::new(Fixed::<8>, on).run(sink),
            (9, 1) => Pass::new(Fixed::<9>, on).run(sink),
            (10, 1) => Pass::new(Fixed::<10>, on).run(sink),
            (states, outputs) => Pass::new(Any { states, outputs }, on).run(sink),
        }
    }
}
