//! Readers of banks for the fuzz tests. Not part of the library's interface.

use super::bank::{Bank, Draws, file};
use super::shards::{BankPlan, ShardedBank, merge, merge_into_file};
use super::{EstimatorError, PresetName, Project};
use crate::progress::Progress;
use crate::storage::work::Share;
use ndarray::Array2;
use std::path::{Path, PathBuf};

/// Most parts of a folder that are read.
const PARTS: usize = 3;

/// Reads a bank in one file.
pub fn read(path: &Path, names: &[&str]) -> Result<(), EstimatorError> {
    file::read(path, names).map(|_| ())
}

/// Writes a bank into one file.
pub fn write(
    path: &Path,
    theta: Array2<f64>,
    features: Array2<f64>,
    names: &[&str],
) -> Result<(), EstimatorError> {
    let draws = Draws {
        theta,
        features,
        redrawn: 0,
    };
    file::write(path, &draws, names)
}

/// Fills a folder with a bank of the default preset.
pub fn fill(project: Project, size: usize, folder: &Path) -> Result<(), EstimatorError> {
    let plan = BankPlan {
        project,
        preset: PresetName::Default,
        size,
        seed: 1,
    };
    plan.fill(folder, Share::WHOLE, &Progress::silent())
        .map(|_| ())
}

/// Merges folders into a folder.
pub fn merged(from: &[PathBuf], out: &Path) -> Result<(), EstimatorError> {
    merge(from, out, &Progress::silent()).map(|_| ())
}

/// Merges folders into a file.
pub fn merged_into_file(from: &[PathBuf], out: &Path) -> Result<(), EstimatorError> {
    merge_into_file(from, out, &Progress::silent()).map(|_| ())
}

/// Opens a folder and reads its first parts, each with its own outcome.
pub fn parts(folder: &Path) -> Result<Vec<Result<(), EstimatorError>>, EstimatorError> {
    let bank = ShardedBank::open(folder)?;
    let parts = 0..bank.parts().len().min(PARTS);
    Ok(parts.map(|part| bank.part(part).map(|_| ())).collect())
}
