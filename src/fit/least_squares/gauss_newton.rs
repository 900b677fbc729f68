use crate::math::MathError;

use argmin::core::{Executor, State, TerminationReason, TerminationStatus};
use nalgebra::DVector;

use super::solver::{DampedGaussNewton, GaussNewtonState, Residuals};
use super::{Bounds, GaussNewton, ResidualProblem};

impl GaussNewton {
    /// Minimises ½‖r(θ)‖² from `start`, which is brought into `bounds` first.
    ///
    /// `scale` is the natural unit of each parameter, such as its prior's width: steps, cutoff and `max_step` are
    /// measured in it. A search that merely ends early is no error: see [`Minimum::converged`].
    pub fn minimise<P: ResidualProblem + ?Sized>(
        &self,
        problem: &P,
        start: &DVector<f64>,
        bounds: &Bounds,
        scale: &DVector<f64>,
    ) -> Result<Minimum, MathError> {
        debug_assert_eq!(
            (start.len(), scale.len()),
            (problem.dimension(), start.len())
        );
        let solver = DampedGaussNewton {
            bounds,
            scale,
            settings: self,
        };
        let start = bounds.project(start);
        let result = Executor::new(Residuals(problem), solver)
            .configure(|state: GaussNewtonState| state.param(start).max_iters(self.max_iterations))
            .ctrlc(false)
            .run()
            .map_err(search_error)?;
        let mut state = result.state;
        let converged = TerminationStatus::Terminated(TerminationReason::SolverConverged);
        Ok(Minimum {
            cost: state.get_cost(),
            converged: *state.get_termination_status() == converged,
            theta: (state.take_param()).ok_or_else(|| MathError::fatal("argmin lost its state"))?,
        })
    }
}

/// Where a search ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Minimum {
    /// θ, inside the bounds.
    pub theta: DVector<f64>,
    /// ½‖r(θ)‖².
    pub cost: f64,
    /// A tolerance was met.
    pub converged: bool,
}

/// Recovers an evaluation's error from argmin's.
fn search_error(error: argmin::core::Error) -> MathError {
    match error.downcast::<MathError>() {
        Ok(MathError::Rejected(cause)) => MathError::Start(cause),
        Ok(MathError::Fatal(cause)) => MathError::Fatal(cause),
        Ok(other) => MathError::fatal(other),
        Err(other) => MathError::Fatal(other.into()),
    }
}

#[cfg(test)]
mod tests;
