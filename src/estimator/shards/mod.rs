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
//! | fill a folder, or a share of it | [`BankPlan::fill`] |
//! | put the folders of a job array together | [`merge`] |
//! | train on more than fits into memory | [`ShardedBank`], a [`Bank`](crate::estimator::bank::Bank) |

mod folder;
mod merge;
mod plan;
#[cfg(test)]
pub(super) mod tests;

pub use folder::ShardedBank;
pub use merge::{merge, merge_into_file};
pub use plan::BankPlan;
