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

pub use folder::ShardedBank;

use crate::estimator::bank::{Draws, Prior, file};
use crate::estimator::error::EstimatorError;
use crate::estimator::project::{PresetName, Project};
use crate::estimator::settings::MOST_SIMULATIONS;
use crate::progress::Progress;
use crate::setting::number;
use crate::storage::files::write_result;
use crate::storage::work::{Manifest, Share, WorkFolder};
use folder::{SHARDS, Shards, VERB, conflict, rows_of_a_shard};
use serde_json::json;
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Layout of the folder; raised when it changes.
const LAYOUT: u32 = 2;
/// Missing shards that a message names.
const NAMED: usize = 10;

/// A bank to be filled: simulations from a study's prior, as features of a preset.
#[derive(Debug, Clone)]
pub struct BankPlan {
    /// Twin, prior, records.
    pub project: Project,
    /// Whose features.
    pub preset: PresetName,
    /// Simulations, M.
    pub size: usize,
    /// Row i depends on it and i alone.
    pub seed: u64,
}

/// Progress of a bank on disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Filled {
    /// Shards in the folder.
    pub there: usize,
    /// Shards of the whole bank.
    pub of: usize,
    /// Simulations in the folder.
    pub rows: usize,
    /// Simulations of shards that this call has made, also in place of damaged ones.
    pub made: usize,
}

impl BankPlan {
    /// Simulates the shards of a share that are not in the folder yet; makes the folder where there is none.
    ///
    /// Shards that are there are read once: one that is not what it was is made again. Several processes may fill one
    /// folder; each shard appears whole.
    pub fn fill(
        &self,
        path: &Path,
        share: Share,
        progress: &Progress,
    ) -> Result<Filled, EstimatorError> {
        if !(1..=MOST_SIMULATIONS).contains(&self.size) {
            return Err(EstimatorError::Bank(format!(
                "a bank of {} simulations; choose between 1 and {}",
                number(self.size as f64),
                number(MOST_SIMULATIONS as f64)
            )));
        }
        let features = &self.project.recipe(self.preset).features;
        let prior = Prior::new(self.project.study(), features.as_ref())?;
        let manifest = self.manifest()?;
        let folder = WorkFolder::open::<EstimatorError>(path, &manifest, &[SHARDS], |_| Ok(None))?;
        let filled = self.filled(&folder, &manifest, share, &prior, progress);
        let made = filled.inspect_err(|error| {
            // It would only stand in the way of the next call. One that is stopped may have others beside it.
            if !matches!(error, EstimatorError::Cancelled(_)) {
                folder.remove_bare(SHARDS);
            }
        })?;
        let filled = finish(path, manifest)?;
        Ok(Filled { made, ..filled })
    }

    /// Makes the shards of a share that are missing; returns the number of their simulations.
    fn filled(
        &self,
        folder: &WorkFolder,
        manifest: &Manifest,
        share: Share,
        prior: &Prior,
        progress: &Progress,
    ) -> Result<usize, EstimatorError> {
        let shards = Shards::list(folder.clone(), manifest.clone())?;
        let mine = || (0..shards.of).filter(|number| share.takes(*number));
        let stage = progress.stage("kept shards", mine().count());
        let mut missing = Vec::new();
        for number in mine() {
            if !shards.keeps(number)? {
                missing.push(number);
            }
            stage.tick()?;
        }
        let rows: usize = missing.iter().map(|n| shards.rows(*n).count()).sum();
        let stage = progress.stage("bank", rows);
        for number in missing {
            let draws = prior.rows(shards.rows(number), self.seed, "bank", &stage)?;
            let bytes =
                file::npz(&draws).map_err(|error| EstimatorError::io(folder.path(), error))?;
            shards.add(number, &bytes)?;
        }
        Ok(rows)
    }

    /// Returns the progress of the folder; a complete one gets the checksums of its shards.
    pub fn finish(&self, path: &Path) -> Result<Filled, EstimatorError> {
        finish(path, self.manifest()?)
    }

    /// Everything that the rows depend on.
    fn manifest(&self) -> Result<Manifest, EstimatorError> {
        let features = &self.project.recipe(self.preset).features;
        Ok((self.project.study())
            .manifest(VERB, LAYOUT)?
            .with("size", self.size)
            .with("rows of a shard", rows_of_a_shard(self.size))
            .with("seed", self.seed)
            .with("features", json!(features)))
    }

    /// Checks whether a bank was made as this plan says.
    pub fn check(&self, bank: &ShardedBank) -> Result<(), EstimatorError> {
        match self.manifest()?.differs(bank.manifest()) {
            None => Ok(()),
            Some(difference) => {
                let problem =
                    format!("a bank of another setting: {difference}; make a bank with this one");
                Err(EstimatorError::file(bank.path(), problem))
            }
        }
    }
}

/// Returns the progress of a folder; the manifest takes one simulation to make.
fn finish(path: &Path, manifest: Manifest) -> Result<Filled, EstimatorError> {
    let shards = Shards::list(WorkFolder::resume(path, &manifest)?, manifest)?;
    shards.finish()?;
    Ok(Filled {
        there: shards.there.len(),
        of: shards.of,
        rows: shards.there.keys().map(|n| shards.rows(*n).count()).sum(),
        made: 0,
    })
}

/// Puts the shards of several folders of one call together in a folder of their own; returns how many there are.
///
/// Every shard is read and checked. Nothing is written before all are known to be there; `out` goes where one of them is not what it was.
pub fn merge(from: &[PathBuf], out: &Path, progress: &Progress) -> Result<usize, EstimatorError> {
    let all = listed(from)?;
    let Some(first) = all.first() else {
        return Ok(0);
    };
    let holders = holders(&all, first.of)?;
    let folder = WorkFolder::open::<EstimatorError>(out, &first.manifest, &[SHARDS], |_| Ok(None))?;
    let new = folder.clone();
    let fill = || {
        let merged = Shards::list(folder, first.manifest.clone())?;
        let stage = progress.stage("merge", holders.len());
        for (number, holder) in holders.into_iter().enumerate() {
            if !merged.there.contains_key(&number) {
                merged.add(number, &holder.bytes(number)?)?;
            }
            stage.tick()?;
        }
        let merged = merged.again()?;
        merged.finish()?;
        Ok(merged.of)
    };
    let count = fill();
    if count.is_err() {
        new.remove()?;
    }
    count
}

/// Puts the shards of several folders, or those of one whole bank, into one `.npz` or `.csv` file; returns the number of rows.
///
/// All rows are in memory at once.
pub fn merge_into_file(
    from: &[PathBuf],
    out: &Path,
    progress: &Progress,
) -> Result<usize, EstimatorError> {
    let all = listed(from)?;
    let Some(first) = all.first() else {
        return Ok(0);
    };
    let holders = holders(&all, first.of)?;
    let stage = progress.stage("merge", holders.len());
    let parts = holders.iter().enumerate().map(|(number, holder)| {
        let draws = holder.draws(number)?;
        stage.tick()?;
        Ok::<_, EstimatorError>(Cow::Owned(draws))
    });
    let draws = Draws::stacked(first.size, parts, |number| holders[number].odd(number))?;
    let names: Vec<&str> = first.names.iter().map(String::as_str).collect();
    write_result(out, |path| file::write(path, &draws, &names))?;
    Ok(draws.theta.nrows())
}

/// Lists each folder; all must be of one call.
fn listed(from: &[PathBuf]) -> Result<Vec<Shards>, EstimatorError> {
    let all = (from.iter())
        .map(|path| {
            let (folder, manifest) = WorkFolder::find(path, VERB)?;
            let finished = manifest.checksums().cloned();
            let shards = Shards::list(folder, manifest.unfinished())?;
            shards.check_finished(finished.as_ref())?;
            Ok(shards)
        })
        .collect::<Result<Vec<Shards>, EstimatorError>>()?;
    for (other, path) in all.iter().zip(from).skip(1) {
        let tell = |key: &str, first: &str, other: &str| format!("{key} is {first} and {other}");
        if let Some(difference) = all[0].manifest.difference(&other.manifest, tell) {
            return Err(EstimatorError::Bank(format!(
                "{} and {} are of different banks: {difference}; merge folders of one call",
                from[0].display(),
                path.display()
            )));
        }
    }
    Ok(all)
}

/// Returns the folders that hold shards 0 … `of` − 1; none may be missing, and copies must agree.
fn holders(all: &[Shards], of: usize) -> Result<Vec<&Shards>, EstimatorError> {
    // What is there is counted before anything is made for every shard: a manifest may speak of far more.
    let there: BTreeSet<usize> = (all.iter().flat_map(|s| s.there.keys().copied())).collect();
    if there.len() < of {
        let folders: Vec<String> = all.iter().take(NAMED).map(Shards::name).collect();
        let absent = (0..of).filter(|number| !there.contains(number));
        let mut missing: Vec<String> = absent.take(NAMED + 1).map(|n| n.to_string()).collect();
        let more = if missing.len() > NAMED { ", …" } else { "" };
        missing.truncate(NAMED);
        return Err(EstimatorError::Bank(format!(
            "{}: {} of {of} shards are there; missing: {}{more}; make these shards first",
            folders.join(", "),
            there.len(),
            missing.join(", ")
        )));
    }
    let mut found = Vec::with_capacity(of);
    for number in there {
        let mut holders = all.iter().filter(|s| s.there.contains_key(&number));
        let Some(holder) = holders.next() else {
            continue;
        };
        if let Some(other) = holders.find(|s| s.there.get(&number) != holder.there.get(&number))
            && let (Some(one), Some(other)) = (holder.file(number), other.file(number))
        {
            return Err(conflict(&one, &other));
        }
        found.push(holder);
    }
    Ok(found)
}

#[cfg(test)]
pub(super) mod tests;
