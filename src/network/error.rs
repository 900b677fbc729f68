//! Errors of networks, each with its remedy.

use crate::progress::Cancelled;
use crate::setting::{SettingError, number};
use std::path::PathBuf;

/// Why a network could not be built, trained, evaluated or restored.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NetworkError {
    /// A training setting is outside its range.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// Samples or stored weights do not fit the network, cannot be read, or are not finite.
    #[error("{0}")]
    Data(String),
    /// The state of the training cannot be kept.
    #[error("{}: {reason}", path.display())]
    Checkpoint {
        /// File.
        path: PathBuf,
        /// Message of the system, and the remedy.
        reason: String,
    },
    /// The loss left the finite numbers.
    #[error(
        "the loss is not finite in epoch {epoch} at learning rate {}; \
         lower learning_rate or standardise features and targets",
        number(*learning_rate)
    )]
    Diverged {
        /// The epoch, from 1.
        epoch: usize,
        /// The learning rate in that epoch.
        learning_rate: f64,
    },
    /// The tensor library failed: in practice, out of memory.
    #[error("tensor operation failed: {0}")]
    Backend(String),
    /// The listener asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl From<dfdx::tensor::CpuError> for NetworkError {
    fn from(error: dfdx::tensor::CpuError) -> Self {
        Self::Backend(error.to_string())
    }
}
