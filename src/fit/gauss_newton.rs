use crate::math::MathError;
use std::fmt;

use argmin::core::Executor;
use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::solver::{DampedGaussNewton, GaussNewtonState, Residuals};
use super::{Bounds, ResidualProblem};
use crate::setting::SettingError;

/// Settings of a bounded, damped Gauss–Newton search for the least ½‖r(θ)‖².
///
/// With s the natural scale of each parameter, J̃ = J diag(s), an iteration takes
///
/// ```text
/// p = argmin ½‖r + J̃ p‖²  over  lower ≤ θ + s∘p ≤ upper      (active set, truncated SVD on each face)
/// θ ← θ + t·s∘p,  t = 1, ½, ¼ …  until  ½‖r(θ + t·s∘p)‖² ≤ ½‖r‖² + 1e-4·t·rᵀJ̃p
/// ```
///
/// A parameter at its bound that would leave is held for the step, and the others are solved again. Directions that
/// the data hardly determine do not move. A point that is rejected (a twin that diverged) or not finite counts as infinitely
/// bad and shortens the step.
///
/// | setting | default | range | meaning |
/// |---|---|---|---|
/// | `max_iterations` | 50 | ≥ 0 | Jacobians at most |
/// | `relative_cutoff` | 1e-8 | [0, 1) | singular values of J̃ below this share of the largest are left out; 1e-3 for noisy Jacobians |
/// | `tolerance` | 1e-10 | ≥ 0 | relative decrease of ½‖r‖² at which to stop |
/// | `step_tolerance` | 1e-8 | ≥ 0 | largest entry of p at which to stop, in scales |
/// | `gradient_tolerance` | 1e-10 | ≥ 0 | cosine between r and a free column of J at which to stop |
/// | `max_step` | none | > 0 | largest entry of p that is taken, in scales |
/// | `max_halvings` | 30 | ≥ 0 | halvings of t before giving up |
///
/// # Example
///
/// # Reference
///
/// Nocedal & Wright, *Numerical Optimization*, second edition, section 10.3; Lakshminarayanan, Guerrero & Rojas,
/// "Fine-Tuning a Simulation-Driven Estimator", section IV, step 2.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GaussNewton {
    /// Jacobians at most.
    pub max_iterations: u64,
    /// Singular values below this share of the largest are left out.
    pub relative_cutoff: f64,
    /// Relative decrease of ½‖r‖² at which to stop.
    pub tolerance: f64,
    /// Step at which to stop, in scales.
    pub step_tolerance: f64,
    /// Cosine between the residual and a free column of the Jacobian at which to stop.
    pub gradient_tolerance: f64,
    /// The largest step that is taken, in scales.
    pub max_step: Option<f64>,
    /// Halvings of a step before giving up.
    pub max_halvings: u32,
}

impl Default for GaussNewton {
    fn default() -> Self {
        Self {
            max_iterations: 50,
            relative_cutoff: 1e-8,
            tolerance: 1e-10,
            step_tolerance: 1e-8,
            gradient_tolerance: 1e-10,
            max_step: None,
            max_halvings: 30,
        }
    }
}

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

    fn check(
        &self,
        dimension: usize,
        start: &DVector<f64>,
        bounds: &Bounds,
        scale: &DVector<f64>,
    ) -> Result<(), MathError> {
        MathError::check_length("start", start.len(), dimension)?;
        MathError::check_length("bounds", bounds.dimension(), dimension)?;
        MathError::check_length("scale", scale.len(), dimension)?;
        let setting = |name: &str, value: f64, valid: bool, remedy: &str| {
            SettingError::unless(valid, name, value, remedy)
        };
        for &value in start {
            setting("start", value, value.is_finite(), "it must be finite")?;
        }
        for &value in scale {
            let valid = value.is_finite() && value > 0.0;
            setting(
                "scale",
                value,
                valid,
                "it must be positive, such as the prior's width",
            )?;
        }
        let cutoff = self.relative_cutoff;
        let valid = (0.0..1.0).contains(&cutoff);
        setting(
            "relative_cutoff",
            cutoff,
            valid,
            "it must lie in [0, 1), such as 1e-8",
        )?;
        for (name, value) in [
            ("tolerance", self.tolerance),
            ("step_tolerance", self.step_tolerance),
            ("gradient_tolerance", self.gradient_tolerance),
        ] {
            setting(
                name,
                value,
                value >= 0.0,
                "it must not be negative, such as 1e-8",
            )?;
        }
        let most = self.max_step.unwrap_or(1.0);
        Ok(setting(
            "max_step",
            most,
            most > 0.0,
            "it must be positive, in scales, or left out",
        )?)
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

/// Why a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StopReason {
    /// The residual is orthogonal to all columns along which θ may move.
    Gradient,
    /// The cost hardly falls any more, and is not expected to.
    Decrease,
    /// The step is too small to matter.
    Step,
    /// No fraction of the step lowers the cost: rounding or noise is reached, the Jacobian is wrong, or points were rejected.
    NoDescent,
    /// The residual exists here, its Jacobian does not.
    NoJacobian,
    /// Out of iterations.
    MaxIterations,
}

impl StopReason {
    /// Whether a tolerance was met.
    pub fn converged(self) -> bool {
        matches!(self, Self::Gradient | Self::Decrease | Self::Step)
    }
}

impl fmt::Display for StopReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Gradient => "gradient below its tolerance",
            Self::Decrease => "decrease below its tolerance",
            Self::Step => "step below its tolerance",
            Self::NoDescent => "no fraction of the step lowers the cost",
            Self::NoJacobian => "no Jacobian at this point",
            Self::MaxIterations => "out of iterations",
        })
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
        use crate::fit::{Bounds, GaussNewton, ResidualProblem};
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
