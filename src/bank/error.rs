//! Why simulations, or files of them, are not there.

use crate::feature::FeatureError;
use crate::progress::Cancelled;
use crate::twin::SimulationError;

/// Why one simulation gave no features.
#[derive(Debug, thiserror::Error)]
pub enum DrawError {
    /// This point cannot be used; others can.
    #[error("{0}")]
    Rejected(String),
    /// No point will help.
    #[error(transparent)]
    Fatal(#[from] BankError),
}

/// Why a set of simulations could not be made.
#[derive(Debug, thiserror::Error)]
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
