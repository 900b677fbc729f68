//! Why a program is no twin.

use crate::storage::files::with_remedy;
use crate::study::StudyError;

/// Why a program cannot be used as a twin.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ProgramError {
    /// A setting out of its range.
    #[error("the program's {0}")]
    Settings(String),
    /// The system cannot start it.
    #[error("the program `{command}` cannot be started: {}", with_remedy(error))]
    Start {
        /// The command.
        command: String,
        /// What the system said.
        error: std::io::Error,
    },
    /// It does not say what it is.
    #[error(
        "the program `{command}` {problem}; asked to describe itself, it must answer one line of JSON with name, parameters, outputs and record"
    )]
    Describe {
        /// The command.
        command: String,
        /// What it did instead.
        problem: String,
    },
    /// What it says makes no study.
    #[error(transparent)]
    Study(#[from] StudyError),
}
