use crate::math::MathError;

use argmin::core::Executor;
use nalgebra::DVector;

use super::settings::StopReason;
use super::solver::{DampedGaussNewton, GaussNewtonState, Residuals};
use super::{Bounds, GaussNewton, ResidualProblem};

impl GaussNewton {
    /// Minimises ½‖r(θ)‖² from `start`, which is brought into `bounds` first.
    ///
    /// `scale` is the natural unit of each parameter, such as its prior's width: steps, cutoff and `max_step` are
    /// measured in it. Deterministic where the problem is.
    ///
    /// # Errors
    ///
    /// [`MathError`]: lengths or settings that do not fit, no value at the start, a fatal evaluation. A search that
    /// merely ends early is no error: see [`Minimum::reason`].
    pub fn minimise<P: ResidualProblem + ?Sized>(
        &self,
        problem: &P,
        start: &DVector<f64>,
        bounds: &Bounds,
        scale: &DVector<f64>,
    ) -> Result<Minimum, MathError> {
        self.check(problem.dimension(), start, bounds, scale)?;
        let solver = DampedGaussNewton {
            bounds,
            scale,
            settings: self,
            steps: 0,
            reason: None,
        };
        let start = bounds.project(start);
        let result = Executor::new(Residuals(problem), solver)
            .configure(|state: GaussNewtonState| state.param(start).max_iters(self.max_iterations))
            .ctrlc(false)
            .run()
            .map_err(search_error)?;
        let count = |what: &str| result.problem.counts.get(what).copied().unwrap_or(0);
        let (evaluations, jacobians) = (count("operator_count"), count("jacobian_count"));
        let mut state = result.state;
        let lost = || MathError::Fatal("argmin lost its state".into());
        Ok(Minimum {
            cost: state.get_cost(),
            theta: state.take_param().ok_or_else(lost)?,
            residual: state.take_residuals().ok_or_else(lost)?,
            iterations: result.solver.steps,
            evaluations,
            jacobians,
            reason: result.solver.reason.unwrap_or(StopReason::MaxIterations),
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
    /// r(θ).
    pub residual: DVector<f64>,
    /// Steps that were taken.
    pub iterations: usize,
    /// Calls of the residual.
    pub evaluations: u64,
    /// Calls of the Jacobian.
    pub jacobians: u64,
    /// Why it ended.
    pub reason: StopReason,
}

impl StopReason {
    /// Returns whether a tolerance was met.
    pub fn converged(self) -> bool {
        matches!(self, Self::Gradient | Self::Decrease | Self::Step)
    }
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

#[cfg(test)]
mod examples {
    #[test]
    fn the_example() -> Result<(), Box<dyn std::error::Error>> {
        use crate::fit::least_squares::{Bounds, GaussNewton, ResidualProblem};
        use crate::math::MathError;
        use nalgebra::{DMatrix, DVector, dmatrix, dvector};

        struct Rosenbrock;
        impl ResidualProblem for Rosenbrock {
            fn dimension(&self) -> usize {
                2
            }
            fn residual(&self, x: &DVector<f64>) -> Result<DVector<f64>, MathError> {
                Ok(dvector![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]])
            }
            fn jacobian(&self, x: &DVector<f64>) -> Result<DMatrix<f64>, MathError> {
                Ok(dmatrix![-20.0 * x[0], 10.0; -1.0, 0.0])
            }
        }

        let (start, bounds, scale) = (
            dvector![-1.2, 1.0],
            Bounds::unbounded(2),
            dvector![1.0, 1.0],
        );
        let minimum = GaussNewton::default().minimise(&Rosenbrock, &start, &bounds, &scale)?;
        assert!((minimum.theta - dvector![1.0, 1.0]).norm() < 1e-9);
        Ok(())
    }
}
