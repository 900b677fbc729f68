//! Equations that take all points of a step in one call.

use crate::math::Lanes;
use crate::twin::{Layout, Now, SimulationError};

/// Equations that are faster for many points in one call than for one after the other: each choice of what to compute is paid once.
///
/// They have no memories, constraints or readout of their own: [`StateSpace`](crate::twin::StateSpace) says these one by one.
pub trait Blocks: Send + Sync {
    /// Sets `dx` to the rates of points, `stride` numbers from one to the next in both.
    fn drift(&self, now: &Now<'_>, stride: usize, x: &[f64], dx: &mut [f64]);

    /// Sets `y` to the outputs of points, `stride` numbers from one to the next in `x`.
    fn observe(&self, now: &Now<'_>, stride: usize, x: &[f64], y: &mut [f64]);

    /// Carries the points of several filters, one a lane, over one step of Euler's rule.
    fn step_lanes(&self, now: &[Now<'_>], x: &mut [Lanes]);

    /// Sets `y` to the one output of these points.
    fn observe_lanes(&self, now: &[Now<'_>], x: &[Lanes], y: &mut [Lanes]);

    /// As [`drift`](Self::drift), of several filters with parameters of their own, `each` numbers of a filter: for equations of which a call
    /// costs more than what it computes, [joined](Self::is_joined) or [wide](Self::is_wide).
    fn drift_joined(&self, _: &[Now<'_>], _at: Layout, _each: usize, _x: &[f64], _dx: &mut [f64]) {}

    /// Returns whether a call waits for an exchange, so that all filters go in one and choose their steps together.
    fn is_joined(&self) -> bool {
        false
    }

    /// Returns whether a call serves several filters at little more than the cost of one. The first filter then chooses the steps of all, as where
    /// each is called for itself.
    fn is_wide(&self) -> bool {
        false
    }

    /// Returns why the last run at the twin's own θ failed, where the equations know more than that a number is not finite: these methods
    /// return no errors.
    fn fault(&self, _theta: &[f64]) -> Option<SimulationError> {
        None
    }
}
