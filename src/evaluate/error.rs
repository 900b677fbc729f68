//! Errors of baselines, studies over many records, and sealed trials.

use crate::diagnose::DiagnoseError;
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
    #[error(
        "the paper has no test points for twin \"{0}\"; take --scenario 0 (θ from the prior) or --scenario uniform (θ from the bounds)"
    )]
    NoPoint(String),
    /// A published test point lies outside the study's bounds.
    #[error(
        "the paper's test point {name} = {} lies outside the study's bounds {bounds}; widen [bounds], or take --scenario 0 (θ from the prior) or --scenario uniform (θ from the bounds)",
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
    /// No simulator independent of the twin exists.
    #[error("no reference simulator for {twin}; choose {known}")]
    NoReference {
        /// Name of the twin.
        twin: String,
        /// Twins that have one.
        known: String,
    },
    /// The study changes a twin that trials take as it is.
    #[error(
        "trials cannot use a study that changes {0}; keep to [record], [prior], [bounds] and [library]"
    )]
    Changed(&'static str),
    /// No trials, or no kinds.
    #[error("no {0}; ask for at least one")]
    Nothing(&'static str),
    /// A kind of trial needs effects, and the study has none.
    #[error(
        "kind {0}: [library] leaves none of the effects that such trials need; allow more effects, or choose other --kinds"
    )]
    NoEffect(&'static str),
    /// Every draw of a truth diverged.
    #[error("trial {0}: every simulated record diverged; narrow [prior] and [bounds]")]
    Runaway(usize),
    /// Keys were asked for before all answers were given.
    #[error("{done} of {of} trials answered; finish the other shares first")]
    Unanswered {
        /// Answers.
        done: usize,
        /// Trials.
        of: usize,
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
    /// The diagnosis failed.
    #[error(transparent)]
    Diagnose(#[from] DiagnoseError),
    /// The caller stopped the work.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
