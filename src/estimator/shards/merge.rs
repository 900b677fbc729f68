//! The folders of a job array, put together.

use super::folder::{SHARDS, Shards, VERB, conflict};
use crate::estimator::bank::{Draws, file};
use crate::estimator::error::EstimatorError;
use crate::progress::Progress;
use crate::storage::work::WorkFolder;
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Missing shards that a message names.
const NAMED: usize = 10;

/// Puts the shards of several folders of one call together in a folder of their own; returns how many there are.
///
/// Every shard is read and checked. Nothing is written before all are known to be there; `out` goes where one of them is not what it was.
pub fn merge(from: &[PathBuf], out: &Path, progress: &Progress) -> Result<usize, EstimatorError> {
    let all = listed(from)?;
    let Some(first) = all.first() else {
        return Ok(0);
    };
    let holders = holders(&all, first.of)?;
    let folder = WorkFolder::open::<EstimatorError>(out, first.manifest(), &[SHARDS], |_| Ok(()))?;
    let new = folder.clone();
    let fill = || {
        let merged = Shards::list(folder, first.manifest().clone())?;
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
    file::write(out, &draws, &names)?;
    Ok(draws.theta.nrows())
}

/// Lists each folder; all must be of one call.
fn listed(from: &[PathBuf]) -> Result<Vec<Shards>, EstimatorError> {
    let all = (from.iter())
        .map(|path| {
            let (folder, manifest) = WorkFolder::find(path, VERB)?;
            Shards::list(folder, manifest.unfinished())
        })
        .collect::<Result<Vec<Shards>, EstimatorError>>()?;
    for (other, path) in all.iter().zip(from).skip(1) {
        if let Some(difference) = all[0].manifest().differs(other.manifest()) {
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
        let absent = (0..of).filter(|number| !there.contains(number));
        let mut missing: Vec<String> = absent.take(NAMED + 1).map(|n| n.to_string()).collect();
        let more = if missing.len() > NAMED { ", …" } else { "" };
        missing.truncate(NAMED);
        return Err(EstimatorError::Bank(format!(
            "{} of {of} shards are there; missing: {}{more}; make these shares first",
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
