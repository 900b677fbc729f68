//! The error of a study.

use crate::likelihood::kalman::FilterError;
use crate::progress::Cancelled;
use crate::record::RecordError;
use crate::setting::did_you_mean;
use crate::storage::files::with_remedy;
use crate::twin::TwinError;
use std::path::PathBuf;

/// Error of a study, its file, or its records.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StudyError {
    /// The study file cannot be read.
    #[error("{}: {}", path.display(), with_remedy(error))]
    Io {
        /// File.
        path: PathBuf,
        /// The system's error.
        error: std::io::Error,
    },
    /// The text of the study file is wrong.
    #[error("{}, line {line}: {message}; correct that line", path.display())]
    Syntax {
        /// File.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Message of the parser, in one line.
        message: String,
    },
    /// A program or an FMU cannot be used as a twin.
    #[error("{0}")]
    Simulator(String),
    /// The study is about an unknown twin.
    #[error("no twin is called \"{given}\"{}; there are {known}", did_you_mean(given, known.split(", ")))]
    Twin {
        /// Name in the file.
        given: String,
        /// Known twins.
        known: String,
    },
    /// Prior, bounds, limits, noise, starts or an effect do not fit the twin.
    #[error(transparent)]
    Adaptation(#[from] TwinError),
    /// An effect of the study file is unknown, or does not fit the twin.
    #[error("{}, line {line}: {error}", path.display())]
    EffectAt {
        /// File.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// The problem there, and the remedy.
        error: TwinError,
    },
    /// The twin is missing, its own parameters, `[fixed]` or `[library]` are wrong.
    #[error("{0}")]
    Table(String),
    /// Step, length or input are wrong, or a record has another step.
    #[error("{0}")]
    Plan(String),
    /// The likelihood of a record cannot be computed.
    #[error(transparent)]
    Filter(#[from] FilterError),
    /// The work was stopped.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// No parameters fit a record.
    #[error(
        "the twin cannot be filtered at any parameters that were tried; check units, step and [bounds]"
    )]
    NoFit,
    /// A record, its file, or its channels are wrong.
    #[error(transparent)]
    Record(#[from] RecordError),
}
