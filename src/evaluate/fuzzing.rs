//! Readers of runs for the fuzz tests. Not part of the library's interface.

use super::paper::BenchmarkRun;
use crate::storage::StorageError;
use crate::storage::work::{Manifest, WorkFolder};
use serde_json::{Map, Value};
use std::path::Path;

/// Reads bytes as run 0 of a folder of `reproduce`. An object is given its checksum, without which no other fault would be found.
pub fn run(folder: &Path, bytes: &[u8]) -> Result<(), StorageError> {
    let manifest = Manifest::new("reproduce", 0);
    let folder = WorkFolder::open::<StorageError>(folder, &manifest, &["runs"], |_| Ok(None))?;
    let path = folder.file("runs/0000.json");
    let _ = std::fs::remove_file(&path);
    match serde_json::from_slice::<Map<String, Value>>(bytes) {
        Ok(piece) => folder.keep("runs", 0, &piece)?,
        Err(_) => std::fs::write(&path, bytes).map_err(|error| StorageError::io(&path, error))?,
    }
    folder
        .kept::<BenchmarkRun>("runs", 0, |_| Ok(()))
        .map(|_| ())
}
