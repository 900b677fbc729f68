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
    /// The data has more features than the architecture was written for.
    #[error(
        "{features} features, but architecture `{architecture}` takes at most {limit}; \
         use fewer features or an architecture with larger `Features`"
    )]
    TooManyFeatures {
        /// [`HeadArchitecture::ID`](super::HeadArchitecture::ID).
        architecture: &'static str,
        /// Columns of the data.
        features: usize,
        /// Most columns that the architecture takes.
        limit: usize,
    },
    /// A matrix has another size than the network or its partner asks for.
    #[error("{what}: expected {expected}, found {found}")]
    Size {
        /// Name of the counted quantity.
        what: &'static str,
        /// The number that is needed.
        expected: usize,
        /// The number that was given.
        found: usize,
    },
    /// A network needs at least one of these.
    #[error("no {what}; at least {least} needed")]
    Empty {
        /// Name of the missing part.
        what: &'static str,
        /// The smallest number that works.
        least: usize,
    },
    /// A value is NaN, infinite, or too large for 32 bits.
    #[error("{what}, row {row}, column {column}: {} is not a finite 32-bit number", number(*value))]
    NotFinite {
        /// Which matrix.
        what: &'static str,
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        column: usize,
        /// The value.
        value: f64,
    },
    /// A part of the samples cannot be read.
    #[error("{0}")]
    Samples(String),
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
    /// A stored tensor is missing, surplus, misshapen or damaged.
    #[error("tensor `{name}` {problem}")]
    Tensor {
        /// Name of the tensor.
        name: String,
        /// Problem and remedy.
        problem: String,
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

impl NetworkError {
    pub(super) fn tensor(name: &str, problem: String) -> Self {
        let name = name.to_owned();
        Self::Tensor { name, problem }
    }
}
