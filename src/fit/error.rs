use std::error::Error;

use super::EvaluationError;
use crate::setting::SettingError;

/// Why nothing was minimised.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OptimiseError {
    /// A vector is not as long as θ.
    #[error("{what} has {length} entries for {dimension} parameters; give one for each")]
    Dimension {
        /// Which vector.
        what: &'static str,
        /// Its length.
        length: usize,
        /// The number of parameters.
        dimension: usize,
    },
    /// A number that cannot be used.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// Something that needs a box was given a half-space.
    #[error(
        "parameter {index} has no finite bounds; points cannot be spread over it, give it both"
    )]
    Unbounded {
        /// Which parameter.
        index: usize,
    },
    /// There is no value at the start.
    #[error("the search cannot begin at its start: {0}; start elsewhere")]
    Start(#[source] Box<dyn Error + Send + Sync>),
    /// The evaluation asked for an end.
    #[error(transparent)]
    Fatal(Box<dyn Error + Send + Sync>),
}

impl OptimiseError {
    /// Recovers what an evaluation said from what argmin carried.
    pub(super) fn from_argmin(error: argmin::core::Error) -> Self {
        match error.downcast::<EvaluationError>() {
            Ok(EvaluationError::Rejected(cause)) => Self::Start(cause),
            Ok(EvaluationError::Fatal(cause)) => Self::Fatal(cause),
            Err(other) => Self::Fatal(other.into()),
        }
    }

    /// Fails unless `length` is `dimension`.
    pub(super) fn check_length(
        what: &'static str,
        length: usize,
        dimension: usize,
    ) -> Result<(), Self> {
        if length == dimension {
            return Ok(());
        }
        Err(Self::Dimension {
            what,
            length,
            dimension,
        })
    }
}
