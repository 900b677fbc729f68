//! The error of the estimator's room.

use crate::feature::FeatureError;
use crate::math::MathError;
use crate::network::NetworkError;
use crate::progress::Cancelled;
use crate::setting::{SettingError, number};
use crate::storage::StorageError;
use crate::storage::untrusted::message;
use crate::study::StudyError;
use crate::twin::SimulationError;
use std::path::{Path, PathBuf};

/// Error of a bank, a pretraining, an estimate, or an estimator file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EstimatorError {
    /// One of several records cannot be estimated.
    #[error("record {number}: {error}")]
    Record {
        /// Its number, from 1.
        number: usize,
        /// The reason.
        error: Box<EstimatorError>,
    },
    /// A setting is out of range.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// The record or the record plan does not fit the study.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// The features cannot be taken from this twin or record.
    #[error(transparent)]
    Feature(#[from] FeatureError),
    /// The network failed.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// A file cannot be read or written, or the work folder cannot be used.
    #[error(transparent)]
    Work(#[from] StorageError),
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The simulator failed in a way that other parameters cannot mend.
    #[error(transparent)]
    Simulation(SimulationError),
    /// One simulation gave no features; other parameters may.
    #[error("{0}")]
    Rejected(String),
    /// Nearly all simulations failed.
    #[error(
        "{failed} of {tried} draws failed ({reason}); shrink the prior, the bounds or the step, or mend the twin"
    )]
    Hopeless {
        /// Failed draws.
        failed: usize,
        /// All draws.
        tried: usize,
        /// Message of the last failure.
        reason: String,
    },
    /// The bank cannot be made, merged, or used for this study.
    #[error("{0}")]
    Bank(String),
    /// A bank that does not fit into memory.
    #[error(
        "bank size = {}; at most {} fit into memory: make a bank on disk, then pretrain from it",
        number(*size as f64),
        number(*most as f64)
    )]
    TooLarge {
        /// Rows that were asked for.
        size: usize,
        /// Most rows in memory.
        most: usize,
    },
    /// The network cannot take these features.
    #[error("{0}")]
    Inputs(String),
    /// A file or folder holds something else, is damaged, or was made for another twin or by another version.
    #[error("{}: {problem}", path.display())]
    File {
        /// File or folder.
        path: PathBuf,
        /// Problem and remedy.
        problem: String,
    },
    /// A file or folder holds no whole bank.
    #[error("{}: {problem}", path.display())]
    NoBank {
        /// File or folder.
        path: PathBuf,
        /// Problem and remedy.
        problem: String,
    },
    /// A file holds no estimator, or one that this program cannot use.
    #[error("{}: {problem}", path.display())]
    NoEstimator {
        /// File.
        path: PathBuf,
        /// Problem and remedy.
        problem: String,
    },
    /// The features simulated at an estimate have no covariance.
    #[error(
        "the features simulated at the estimate cannot be whitened: {0}; a twin without noise has no statistics: give it noise levels"
    )]
    Whitening(MathError),
    /// The record does not determine the parameters.
    #[error("{0}")]
    Undetermined(String),
    /// A numerical search failed.
    #[error(transparent)]
    Search(#[from] MathError),
}

impl EstimatorError {
    /// A file that cannot be read or written.
    pub(crate) fn io(path: &Path, error: std::io::Error) -> Self {
        StorageError::io(path, error).into()
    }

    /// A file with this problem, which may quote the file's content.
    pub(crate) fn file(path: &Path, problem: impl ToString) -> Self {
        Self::File {
            path: path.into(),
            problem: message(&problem.to_string()),
        }
    }

    /// A file that holds no bank, or a damaged one.
    pub(crate) fn no_bank(path: &Path, reason: &str, remedy: &str) -> Self {
        let reason = message(reason);
        Self::NoBank {
            path: path.into(),
            problem: format!("no bank ({reason}); {remedy}"),
        }
    }
}
