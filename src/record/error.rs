//! Errors of drives, records and their files.

use crate::storage::files::with_remedy;
use std::path::{Path, PathBuf};

/// A fault in a drive, a record or its file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// A step that is no positive number.
    #[error("step = {0} s; the step must be a positive number of seconds")]
    Step(f64),
    /// No sample at all.
    #[error("no samples; at least one is needed")]
    Empty,
    /// Inputs and outputs of different lengths.
    #[error("{inputs} rows of inputs and {outputs} rows of outputs; both need the same number")]
    Lengths {
        /// Rows of inputs.
        inputs: usize,
        /// Rows of outputs.
        outputs: usize,
    },
    /// No output channel.
    #[error("the record has no output; give at least one column y")]
    NoOutput,
    /// An input or output that is NaN or infinite.
    #[error("{kind} {channel}, sample {sample} is {value}; {kind}s must be finite")]
    NotFinite {
        /// "input" or "output".
        kind: &'static str,
        /// Channel, from 1.
        channel: usize,
        /// Sample, from 0.
        sample: usize,
        /// The value.
        value: f64,
    },
    /// Channels other than the twin's.
    #[error(
        "the record has {given} {kind}, the twin has {expected} ({names}); name its columns so"
    )]
    Channels {
        /// "inputs" or "outputs".
        kind: &'static str,
        /// In the record.
        given: usize,
        /// In the twin.
        expected: usize,
        /// Columns that the file needs.
        names: String,
    },
    /// A file that cannot be read or written.
    #[error("{}: {}", path.display(), with_remedy(error))]
    Io {
        /// File.
        path: PathBuf,
        /// The system's error.
        error: std::io::Error,
    },
    /// A file that holds no record.
    #[error("{}{problem}", path.display())]
    File {
        /// File.
        path: PathBuf,
        /// Row and column, what is wrong there, and the remedy.
        problem: String,
    },
}

impl RecordError {
    /// Creates an error about a file as a whole.
    pub(super) fn file(path: &Path, problem: impl std::fmt::Display) -> Self {
        Self::File {
            path: path.into(),
            problem: format!(": {problem}"),
        }
    }

    /// Creates an error about a cell; the header is row 1.
    pub(super) fn cell(path: &Path, row: usize, column: &str, problem: String) -> Self {
        Self::File {
            path: path.into(),
            problem: format!(", row {row}, column {column}: {problem}"),
        }
    }

    /// Creates an error of the file system.
    pub(super) fn io(path: &Path, error: std::io::Error) -> Self {
        Self::Io {
            path: path.into(),
            error,
        }
    }
}
