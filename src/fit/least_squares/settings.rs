//! Settings of a search.

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
/// Source: Nocedal & Wright, *Numerical Optimization*, second edition, section 10.3; Lakshminarayanan, Guerrero & Rojas,
/// "Fine-Tuning a Simulation-Driven Estimator", section IV, step 2.
#[derive(Debug, Clone)]
pub struct GaussNewton {
    /// Jacobians at most.
    pub max_iterations: u64,
    /// Singular values of J̃ below this share of the largest are left out; 1e-3 for noisy Jacobians.
    pub relative_cutoff: f64,
    /// Relative decrease of ½‖r‖² at which to stop.
    pub tolerance: f64,
    /// Largest entry of p at which to stop, in scales.
    pub step_tolerance: f64,
    /// The largest entry of p that is taken, in scales.
    pub max_step: Option<f64>,
}

/// Cosine between r and a free column of J at which to stop.
pub(super) const GRADIENT_TOLERANCE: f64 = 1e-10;
/// Halvings of t before giving up.
pub(super) const MAX_HALVINGS: u32 = 30;

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
