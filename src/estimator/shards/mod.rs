//! Banks on disk: a folder of shards, filled by any number of threads, processes and machines.
//!
//! ```text
//! DIR/manifest.json                    what the bank depends on; once it is whole, the checksum of each shard
//! DIR/shards/000017-<sha256>.npz       rows 17·r … 18·r − 1: theta (r × d), features (r × n)
//! ```
//!
//! Row i depends on (seed, i) alone: who simulates it, and when, changes no bit. A shard appears whole, under a name that
//! holds its checksum, so that folders can be compared and merged without opening a file.
//!
//! | to … | look at |
//! |---|---|
//! | simulate from a study's prior | [`Prior`] |
//! | fill a folder, or a share of it | [`BankPlan::fill`] |
//! | put the folders of a job array together | [`merge`] |
//! | train on more than fits into memory | [`ShardedBank`], a [`Bank`](crate::estimator::bank::Bank) |
//!
//! ```
//! use truetwin::estimator::bank::{Bank, file};
//! use truetwin::progress::Progress;
//! use truetwin::estimator::shards::{BankPlan, Filled, ShardedBank, merge, merge_into_file};
//! use truetwin::estimator::{PresetName, Project};
//! use truetwin::study::{RecordPlan, Study};
//! use truetwin::twins::VanDerPol;
//!
//! let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 100))?;
//! let plan = BankPlan { project: study.into(), preset: PresetName::Default, size: 40, seed: 1 };
//! let place = tempfile::tempdir()?;
//! let [one, two, all] = ["one", "two", "all"].map(|name| place.path().join(name));
//! // Two jobs, each with a folder of its own; then one bank.
//! let filled: Filled = plan.fill(&one, "1/2".parse()?, &Progress::silent())?;
//! assert!(filled.there < filled.of);
//! plan.fill(&two, "2/2".parse()?, &Progress::silent())?;
//! merge(&[one.clone(), two.clone()], &all, &Progress::silent())?;
//! let bank = ShardedBank::open(&all)?;
//! assert_eq!((bank.rows(), bank.seed()), (40, 1));
//!
//! // Or one file for NumPy.
//! let archive = place.path().join("bank.npz");
//! assert_eq!(merge_into_file(&[one, two], &archive, &Progress::silent())?, 40);
//! assert_eq!(file::read(&archive, &["nu"])?.theta.nrows(), 40);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod folder;
mod merge;
mod plan;
mod prior;

pub use folder::ShardedBank;
pub use merge::{merge, merge_into_file};
pub use plan::{BankPlan, Filled};
pub use prior::Prior;
