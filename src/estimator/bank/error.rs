//! Why simulations, or files of them, are not there.

use crate::feature::FeatureError;
use crate::progress::Cancelled;
use crate::twin::SimulationError;

/// Why one simulation gave no features.
///
/// ```
/// use truetwin::estimator::bank::DrawError;
///
/// let error = DrawError::Rejected("diverged at t = 3 s".into()); // the next draw may do
/// assert_eq!(error.to_string(), "diverged at t = 3 s");
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DrawError {
    /// This point cannot be used; others can.
    #[error("{0}")]
    Rejected(String),
    /// No point will help.
    #[error(transparent)]
    Fatal(#[from] BankError),
}

/// Why a set of simulations could not be made.
///
/// ```
/// use truetwin::estimator::bank::BankError;
///
/// let error = BankError::Hopeless { failed: 95, tried: 100, reason: "diverged at t = 3 s".into() };
/// assert!(error.to_string().starts_with("95 of 100 draws failed"));
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BankError {
    /// The simulator failed for good.
    #[error(transparent)]
    Simulation(SimulationError),
    /// The features cannot be extracted from any run.
    #[error(transparent)]
    Feature(FeatureError),
    /// Nearly all draws failed.
    #[error(
        "{failed} of {tried} draws failed ({reason}); shrink the prior, the bounds or the step, or mend the twin"
    )]
    Hopeless {
        /// Failed draws.
        failed: usize,
        /// All draws.
        tried: usize,
        /// What the last failure said.
        reason: String,
    },
    /// The draw of an input failed.
    #[error("the input cannot be made: {0}")]
    Input(String),
    /// Stopped from outside.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
