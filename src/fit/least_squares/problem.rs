use crate::math::MathError;
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
