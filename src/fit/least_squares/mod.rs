//! Least squares of residuals in a box.
//!
//! | for | take |
//! |---|---|
//! | residuals with a Jacobian | [`GaussNewton::minimise`] |
//! | starts that are spread over a box | [`space_filling`] |
//!
//! A problem to minimise implements [`ResidualProblem`]; it says with [`MathError`] whether a failure costs one point (a twin that diverged) or
//! everything. Nothing here prints or draws unseeded randomness.

mod bounds;
mod halton;

pub use bounds::Bounds;
pub use halton::space_filling;

use super::solver::{LocalModel, Objective, Solver};
use crate::math::{MathError, thin_svd};
use nalgebra::{DMatrix, DVector};

/// A vector of residuals r(θ) whose half squared norm is to be small.
///
/// θ has length d, r has length m (any, but the same at all θ), the Jacobian ∂r/∂θ is m × d. A prior or ridge enters as
/// further rows: γ/2 ‖θ − θ₀‖² is the rows √γ (θ − θ₀).
pub trait ResidualProblem {
    /// d, the number of parameters.
    fn dimension(&self) -> usize;

    /// r(θ); [`MathError::Rejected`] where θ has no residual, [`MathError::Fatal`] to stop.
    fn residual(&self, theta: &DVector<f64>) -> Result<DVector<f64>, MathError>;

    /// ∂r/∂θ; [`Stencil`](crate::math::Stencil) has finite differences.
    fn jacobian(&self, theta: &DVector<f64>) -> Result<DMatrix<f64>, MathError>;
}

/// Settings of a bounded, damped Gauss–Newton search for the least ½‖r(θ)‖².
///
/// The search is that of [`Solver`], in units of a natural scale s of each parameter. Directions that the data hardly determine do not move:
/// of J̃ = J diag(s) only singular values above a cutoff count. A point that is rejected (a twin that diverged) or not finite counts as
/// infinitely bad and shortens the step.
///
/// Source: Lakshminarayanan, Guerrero & Rojas, "Fine-Tuning a Simulation-Driven Estimator", section IV, step 2.
#[derive(Debug, Clone)]
pub struct GaussNewton {
    /// Jacobians at most.
    pub max_iterations: u64,
    /// Singular values of J̃ below this share of the largest are left out; 1e-3 for noisy Jacobians.
    pub relative_cutoff: f64,
    /// Relative decrease of ½‖r‖² at which to stop.
    pub tolerance: f64,
    /// Largest entry of a step at which to stop, in scales.
    pub step_tolerance: f64,
    /// Largest entry of a step that is taken, in scales.
    pub max_step: Option<f64>,
}

/// Damping from the start: residuals are taken at their word until a step fails.
const DAMPING: f64 = 1e-9;
/// Trial points after each Jacobian: damping grows eightfold from one to the next and is of no use long before the last.
const TRIALS: usize = 30;

impl Default for GaussNewton {
    fn default() -> Self {
        Self {
            max_iterations: 50,
            relative_cutoff: 1e-8,
            tolerance: 1e-10,
            step_tolerance: 1e-8,
            max_step: None,
        }
    }
}

/// End of a search.
#[derive(Debug, Clone, PartialEq)]
pub struct Minimum {
    /// θ, inside the bounds.
    pub theta: DVector<f64>,
    /// ½‖r(θ)‖².
    pub cost: f64,
    /// A tolerance was met.
    pub converged: bool,
}

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
        let scaled = Scaled {
            problem,
            scale,
            cutoff: self.relative_cutoff,
        };
        let start = bounds.project(start);
        let lower = bounds.lower().component_div(scale);
        let upper = bounds.upper().component_div(scale);
        let solver = Solver {
            lower: lower.as_slice(),
            upper: upper.as_slice(),
            longest: vec![self.max_step.unwrap_or(f64::INFINITY); start.len()],
            held: vec![false; start.len()],
            iterations: self.max_iterations,
            trials: TRIALS,
            damping: DAMPING,
            least_damping: DAMPING,
            gain: 0.0,
            relative_gain: self.tolerance,
            least_step: self.step_tolerance,
            least_cost: f64::INFINITY,
            models_end: false,
        };
        match solver.minimise(&scaled, &start.component_div(scale)) {
            Ok(end) => Ok(Minimum {
                theta: bounds.project(&end.x.component_mul(scale)),
                cost: end.cost,
                converged: end.converged,
            }),
            // A start without derivatives is its own end.
            Err(MathError::Rejected(_)) => match scaled.residual(&start) {
                Ok(residual) => Ok(Minimum {
                    cost: 0.5 * residual.norm_squared(),
                    theta: start,
                    converged: false,
                }),
                Err(MathError::Rejected(cause)) => Err(MathError::Start(cause)),
                Err(error) => Err(error),
            },
            Err(error) => Err(error),
        }
    }
}

/// A residual problem in units of its scale.
struct Scaled<'a, P: ?Sized> {
    problem: &'a P,
    scale: &'a DVector<f64>,
    cutoff: f64,
}

impl<P: ResidualProblem + ?Sized> Scaled<'_, P> {
    fn residual(&self, theta: &DVector<f64>) -> Result<DVector<f64>, MathError> {
        let residual = self.problem.residual(theta)?;
        match residual.iter().all(|r| r.is_finite()) {
            true => Ok(residual),
            false => Err(MathError::rejected("a residual is not finite")),
        }
    }
}

impl<P: ResidualProblem + ?Sized> Objective for Scaled<'_, P> {
    type Trial = DVector<f64>;
    type Error = MathError;

    fn is_rejection(error: &MathError) -> bool {
        matches!(error, MathError::Rejected(_))
    }

    fn cost(&self, x: &DVector<f64>) -> Result<(f64, DVector<f64>), MathError> {
        let residual = self.residual(&x.component_mul(self.scale))?;
        Ok((0.5 * residual.norm_squared(), residual))
    }

    fn model(
        &self,
        x: &DVector<f64>,
        trial: Option<DVector<f64>>,
    ) -> Result<LocalModel, MathError> {
        let theta = x.component_mul(self.scale);
        let residual = trial.map_or_else(|| self.residual(&theta), Ok)?;
        let mut jacobian = self.problem.jacobian(&theta)?;
        for (mut column, scale) in jacobian.column_iter_mut().zip(self.scale.iter()) {
            column *= *scale;
        }
        if !jacobian.iter().all(|v| v.is_finite()) {
            return Err(MathError::rejected(
                "an entry of the Jacobian is not finite",
            ));
        }
        let svd = thin_svd(&jacobian).ok_or(MathError::NotFinite)?;
        let least = self.cutoff * svd.values.iter().copied().fold(0.0, f64::max);
        let kept = svd.values.map(|s| if s > least { s } else { 0.0 });
        // J̃ without its weak directions, in coordinates in which its rows are few.
        let root = DMatrix::from_diagonal(&kept) * svd.right.transpose();
        Ok(LocalModel {
            cost: 0.5 * residual.norm_squared(),
            gradient: root.tr_mul(&svd.left.tr_mul(&residual)),
            information: root.tr_mul(&root),
        })
    }
}

#[cfg(test)]
mod tests;
