//! Errors of baselines, studies over many records, and sealed trials.

use crate::likelihood::kalman::FilterError;
use crate::math::MathError;
use crate::progress::Cancelled;
use crate::record::RecordError;
use crate::setting::{SettingError, number};
use crate::storage::StorageError;
use crate::study::StudyError;
use crate::twin::{Interval, SimulationError, TwinError};
use std::path::PathBuf;

/// Error of an evaluation.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluateError {
    /// The twin has no published test points.
    #[error("the paper has no test points for twin \"{0}\"; draw θ from the prior or the bounds")]
    NoPoint(String),
    /// A published test point lies outside the study's bounds.
    #[error(
        "the paper's test point {name} = {} lies outside the study's bounds {bounds}; widen the bounds, or draw θ from the prior or the bounds",
        number(*value)
    )]
    Outside {
        /// Parameter.
        name: &'static str,
        /// Its value there.
        value: f64,
        /// Bounds of the study.
        bounds: Interval,
    },
    /// The estimator failed on every record.
    #[error("the estimator failed on every record; on the first: {0}")]
    Hopeless(String),
    /// No trials, or no kinds.
    #[error("no {0}; ask for at least one")]
    Nothing(&'static str),
    /// A twin and its study allow no truth of a kind.
    #[error("kind {kind}: {reason}, or choose other kinds")]
    NoDeparture {
        /// Kind of truth.
        kind: &'static str,
        /// Reason and remedy.
        reason: &'static str,
    },
    /// Every draw of a truth was given up.
    #[error(
        "trial {trial}, kind {kind}: no truth in {of} draws: {reasons}; narrow prior and bounds, or choose other kinds"
    )]
    NoTruth {
        /// Number of the trial.
        trial: usize,
        /// Kind of truth.
        kind: &'static str,
        /// Draws.
        of: u64,
        /// Counts and reasons.
        reasons: String,
    },
    /// A file of the folder is not as this program wrote it.
    #[error("{}: cannot be used ({reason}); {remedy}", path.display())]
    Damaged {
        /// File.
        path: PathBuf,
        /// Mismatch.
        reason: String,
        /// Remedy.
        remedy: &'static str,
    },
    /// The work folder cannot be used.
    #[error(transparent)]
    Work(#[from] StorageError),
    /// The study's inputs cannot be drawn.
    #[error(transparent)]
    Plan(#[from] StudyError),
    /// The record cannot be read, or does not fit the twin.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The start does not fit the twin, or lies outside the bounds.
    #[error(transparent)]
    Parameter(#[from] TwinError),
    /// The twin failed.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The search failed, or a derivative could not be taken.
    #[error(transparent)]
    Math(#[from] MathError),
    /// The filter failed.
    #[error(transparent)]
    Filter(#[from] FilterError),
    /// A setting cannot be used.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// The caller stopped the work.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
