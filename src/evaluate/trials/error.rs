//! Why there is no scorecard.

use super::world::World;
use crate::diagnose::DiagnoseError;
use crate::progress::Cancelled;
use crate::record::RecordError;
use crate::storage::work::WorkError;
use crate::study::PlanError;
use std::path::PathBuf;

/// Why there is no scorecard.
///
/// ```
/// use truetwin::study::{RecordPlan, Study};
/// use truetwin::twins::VanDerPol;
/// use truetwin::evaluate::trials::{Settings, Withheld, WithheldError};
///
/// let study = Study::new("van-der-pol", VanDerPol, RecordPlan::autonomous(0.05, 300))?;
/// let none = Settings { trials: 0, ..Settings::default() };
/// let refused: Option<WithheldError> = Withheld::new(&study, none).err();
/// assert!(refused.is_some());
/// # Ok::<(), truetwin::study::StudyError>(())
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WithheldError {
    /// There is no world of this twin.
    #[error(
        "withheld trials need a world written apart from the twin, and there is none of {0}; choose {known}",
        known = World::known().join(" or ")
    )]
    NoWorld(String),
    /// The study has changed the twin.
    #[error(
        "withheld trials are of the twin as it is, and the study changes {0}; keep to [record], [prior], [bounds] and [library]"
    )]
    Changed(&'static str),
    /// No trials, or no kinds.
    #[error("no {0}; ask for at least one")]
    Nothing(&'static str),
    /// A kind that needs effects, in a study without.
    #[error(
        "kind {0}: [library] leaves none of the effects that such trials need; allow more effects, or choose other --kinds"
    )]
    NoEffect(&'static str),
    /// No truth could be drawn whose record does not run away.
    #[error(
        "trial {0}: no record could be made that does not run away; narrow [prior] and [bounds]"
    )]
    Runaway(usize),
    /// Of the folder.
    #[error(transparent)]
    Work(#[from] WorkError),
    /// Keys are opened once every answer is there, and some are not.
    #[error("{there} of {of} answers are there; finish the other shares first")]
    Unanswered {
        /// Answers.
        there: usize,
        /// Trials.
        of: usize,
    },
    /// A file of the folder that this program did not write.
    #[error("{}: cannot be used ({reason}); {remedy}", path.display())]
    Damaged {
        /// File.
        path: PathBuf,
        /// What does not fit.
        reason: String,
        /// What can be done.
        remedy: &'static str,
    },
    /// Of the input.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// Of the input, a record or its file.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// Of a diagnosis that no trial can have.
    #[error(transparent)]
    Diagnose(#[from] DiagnoseError),
    /// No threads.
    #[error("no threads could be started: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// Stopped from outside.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
