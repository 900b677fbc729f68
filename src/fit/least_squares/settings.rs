//! Settings of a search, and why it ended.

use super::Bounds;
use crate::math::MathError;
use crate::setting::SettingError;
use nalgebra::DVector;
use serde::{Deserialize, Serialize};
use std::fmt;

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
    /// Checks lengths and settings.
    pub(super) fn check(
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

/// Reason for the end of a search.
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
