//! Readers of runs for the fuzz tests. Not part of the library's interface.

use super::paper::BenchmarkRun;
use crate::storage::StorageError;
use crate::storage::work::WorkFolder;
use std::path::Path;

/// Reads run 0 of a folder of `reproduce`.
pub fn run(folder: &Path) -> Result<(), StorageError> {
    let (folder, _) = WorkFolder::find(folder, "reproduce")?;
    folder
        .kept::<BenchmarkRun>("runs", 0, |_| Ok(()))
        .map(|_| ())
}
