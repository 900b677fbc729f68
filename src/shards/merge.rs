//! The folders of a job array, put together.

use super::ShardsError;
use super::folder::{SHARDS, ShardedBank, Shards};
use super::plan::VERB;
use crate::bank::{Bank, BankError, Draws, file};
use crate::files;
use crate::progress::Progress;
use crate::work::{WorkError, WorkFolder};
use ndarray::{Array2, Axis, concatenate};
use std::path::{Path, PathBuf};

/// Missing shards that a message names.
const NAMED: usize = 10;

/// Puts the shards of several folders of one call together in a folder of their own; returns how many there are.
///
/// Every shard is read and checked. Nothing is written before all are known to be there.
///
/// # Errors
///
/// [`ShardsError`]: folders of different calls, shards that are missing, differ between folders, or are not what they were.
pub fn merge(from: &[PathBuf], out: &Path, progress: &Progress) -> Result<usize, ShardsError> {
    let all = (from.iter())
        .map(|path| {
            let (folder, manifest) = WorkFolder::find(path, VERB)?;
            Shards::list(folder, manifest.unfinished())
        })
        .collect::<Result<Vec<Shards>, ShardsError>>()?;
    let Some((first, others)) = all.split_first() else {
        return Ok(0);
    };
    for (other, path) in others.iter().zip(&from[1..]) {
        if let Some(difference) = first.manifest().differs(other.manifest()) {
            return Err(ShardsError::Strangers {
                one: from[0].clone(),
                other: path.clone(),
                difference,
            });
        }
    }
    let mut sources = Vec::with_capacity(first.of);
    let mut missing = Vec::new();
    for number in 0..first.of {
        let mut holders = all.iter().filter(|s| s.there.contains_key(&number));
        let Some(holder) = holders.next() else {
            missing.push(number.to_string());
            continue;
        };
        if let Some(other) = holders.find(|s| s.there.get(&number) != holder.there.get(&number))
            && let (Some(one), Some(other)) = (holder.file(number), other.file(number))
        {
            return Err(ShardsError::Conflict { one, other });
        }
        sources.push((number, holder));
    }
    if !missing.is_empty() {
        let there = first.of - missing.len();
        let more = if missing.len() > NAMED { ", …" } else { "" };
        missing.truncate(NAMED);
        return Err(ShardsError::Missing {
            there,
            of: first.of,
            missing: format!("{}{more}", missing.join(", ")),
        });
    }
    let folder = WorkFolder::open::<ShardsError>(out, first.manifest(), &[SHARDS], |_| Ok(()))?;
    let merged = Shards::list(folder, first.manifest().clone())?;
    let stage = progress.stage("merge", sources.len());
    for (number, source) in sources {
        if !merged.there.contains_key(&number) {
            merged.add(number, &source.bytes(number)?)?;
        }
        stage.tick().map_err(BankError::from)?;
    }
    let merged = merged.again()?;
    merged.finish()?;
    Ok(merged.of)
}

/// Puts the shards of several folders, or those of one whole bank, into one `.npz` or `.csv` file; returns the number of rows.
///
/// All rows are in memory at once.
///
/// # Errors
///
/// As [`merge`] and [`file::write`].
pub fn merge_into_file(
    from: &[PathBuf],
    out: &Path,
    progress: &Progress,
) -> Result<usize, ShardsError> {
    let place = files::folder(out);
    let merged = tempfile::Builder::new()
        .prefix(".truetwin-")
        .tempdir_in(place)
        .map_err(|error| WorkError::io(place, error))?;
    let path = merged.path().join("bank");
    merge(from, &path, progress)?;
    let bank = ShardedBank::open(&path)?;
    let parts = (0..bank.parts().len())
        .map(|index| bank.part(index))
        .collect::<Result<Vec<_>, _>>()?;
    let stacked = |of: fn(&Draws) -> &Array2<f64>| {
        let views: Vec<_> = parts.iter().map(|part| of(part).view()).collect();
        concatenate(Axis(0), &views).unwrap_or_default()
    };
    let draws = Draws {
        theta: stacked(|draws| &draws.theta),
        features: stacked(|draws| &draws.features),
        redrawn: 0,
    };
    let names: Vec<&str> = bank.names().iter().map(String::as_str).collect();
    file::write(out, &draws, &names)?;
    Ok(draws.theta.nrows())
}
