//! Why a file is no twin.

use crate::storage::files::with_remedy;
use crate::study::StudyError;
use std::path::PathBuf;

/// Why an FMU cannot be used as a twin.
///
/// ```
/// use truetwin::external::fmu::{FmuError, FmuSettings, FmuTwin};
///
/// let error = FmuTwin::open("no-such.fmu".as_ref(), FmuSettings::default()).err();
/// assert!(matches!(error, Some(FmuError::Io { .. })));
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FmuError {
    /// The file cannot be read.
    #[error("{}: {}", path.display(), with_remedy(error))]
    Io {
        /// File.
        path: PathBuf,
        /// What the system said.
        error: std::io::Error,
    },
    /// It is no FMU that can be used.
    #[error("{}: no usable FMU: {problem}; export it again", path.display())]
    Archive {
        /// File.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// Its library cannot be loaded, or makes no instance.
    #[error(
        "{}: the FMU cannot be instantiated: {problem}; export it with a binary for this platform, for co-simulation", path.display()
    )]
    Instance {
        /// File.
        path: PathBuf,
        /// What the loader or the FMU said.
        problem: String,
    },
    /// What is asked of it, it does not have.
    #[error("{}: {problem}", path.display())]
    Variables {
        /// File.
        path: PathBuf,
        /// What is wrong, with the remedy.
        problem: String,
    },
    /// What it describes makes no study.
    #[error("{}: {error}", path.display())]
    Study {
        /// File.
        path: PathBuf,
        /// Why.
        error: StudyError,
    },
}
