use std::error::Error;

use nalgebra::{DMatrix, DVector};

/// A vector of residuals r(θ) whose half squared norm is to be small.
///
/// θ has length d, r has length m (any, but the same at all θ), the Jacobian ∂r/∂θ is m × d. A prior or ridge enters as
/// further rows: γ/2 ‖θ − θ₀‖² is the rows √γ (θ − θ₀).
pub trait ResidualProblem {
    /// d, the number of parameters.
    fn dimension(&self) -> usize;

    /// r(θ).
    ///
    /// # Errors
    ///
    /// [`EvaluationError::Rejected`] where θ has no residual, [`EvaluationError::Fatal`] to stop.
    fn residual(&self, theta: &DVector<f64>) -> Result<DVector<f64>, EvaluationError>;

    /// ∂r/∂θ; [`Stencil`](crate::math::Stencil) has finite differences.
    ///
    /// # Errors
    ///
    /// As [`residual`](Self::residual).
    fn jacobian(&self, theta: &DVector<f64>) -> Result<DMatrix<f64>, EvaluationError>;
}

/// Why a function has no value at θ, and whether that matters elsewhere.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluationError {
    /// There is nothing at *this* θ, as when the twin diverged. The search goes on elsewhere.
    #[error("no value at this point: {0}")]
    Rejected(#[source] Box<dyn Error + Send + Sync>),
    /// No θ will do, or the work was cancelled. The search ends.
    #[error(transparent)]
    Fatal(Box<dyn Error + Send + Sync>),
}

impl EvaluationError {
    /// [`Rejected`](Self::Rejected), from an error or a message.
    pub fn rejected(cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::Rejected(cause.into())
    }

    /// [`Fatal`](Self::Fatal), from an error or a message.
    pub fn fatal(cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::Fatal(cause.into())
    }
}
