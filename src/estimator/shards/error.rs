//! Why there is no bank on disk.

use super::PriorError;
use crate::estimator::bank::BankError;
use crate::estimator::bank::file::BankFileError;
use crate::storage::StorageError;
use std::path::PathBuf;

/// Why a bank on disk cannot be made or used.
///
/// ```
/// use truetwin::progress::Progress;
/// use truetwin::estimator::shards::{BankPlan, ShardsError};
/// use truetwin::estimator::{PresetName, Project};
/// use truetwin::study::{RecordPlan, Study};
/// use truetwin::twins::VanDerPol;
/// use truetwin::storage::work::Share;
///
/// let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 100))?;
/// let none = BankPlan { project: study.into(), preset: PresetName::Default, size: 0, seed: 1 };
/// let error = none.fill("nowhere".as_ref(), Share::WHOLE, &Progress::silent()).unwrap_err();
/// assert!(matches!(error, ShardsError::Size(0)));
/// # Ok::<(), truetwin::study::StudyError>(())
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ShardsError {
    /// No rows.
    #[error("a bank of {0} simulations; choose between 1 and {most}", most = super::plan::MOST)]
    Size(usize),
    /// Of the folder.
    #[error(transparent)]
    Work(#[from] StorageError),
    /// Of a shard.
    #[error(transparent)]
    File(#[from] BankFileError),
    /// Of the simulations.
    #[error(transparent)]
    Bank(#[from] BankError),
    /// Of the study.
    #[error(transparent)]
    Prior(#[from] PriorError),
    /// Two folders hold different rows under the same numbers.
    #[error(
        "{} and {} differ, and should hold the same rows; make both with the same build on machines of one kind",
        one.display(), other.display()
    )]
    Conflict {
        /// A shard.
        one: PathBuf,
        /// The other.
        other: PathBuf,
    },
    /// Not all shards are there.
    #[error(
        "{}: {there} of {of} shards are there; run the same `truetwin bank` call again to make the others",
        path.display()
    )]
    Incomplete {
        /// Folder.
        path: PathBuf,
        /// Shards.
        there: usize,
        /// Shards of the whole.
        of: usize,
    },
    /// All folders together do not hold all shards.
    #[error("{there} of {of} shards are there; missing: {missing}; make these shares first")]
    Missing {
        /// Shards.
        there: usize,
        /// Shards of the whole.
        of: usize,
        /// The first of those that are not.
        missing: String,
    },
    /// The bank was made for something else.
    #[error("{}: a bank of another setting: {difference}; make a bank with this one", path.display())]
    Other {
        /// Folder.
        path: PathBuf,
        /// What is different.
        difference: String,
    },
    /// Folders of different banks.
    #[error("{} and {} are of different banks: {difference}; merge folders of one call", one.display(), other.display())]
    Strangers {
        /// A folder.
        one: PathBuf,
        /// The other.
        other: PathBuf,
        /// What is different.
        difference: String,
    },
}
