//! Readers of work folders for the fuzz tests. Not part of the library's interface.

use super::StorageError;
use super::work::WorkFolder;
use serde::de::DeserializeOwned;
use std::path::Path;

/// Reads the manifest of a folder that `verb` is said to have made.
pub fn manifest(folder: &Path, verb: &'static str) -> Result<(), StorageError> {
    WorkFolder::find(folder, verb).map(|_| ())
}

/// Reads piece 0 of a part.
pub fn piece<T: DeserializeOwned>(
    folder: &Path,
    verb: &'static str,
    part: &str,
) -> Result<(), StorageError> {
    let (folder, _) = WorkFolder::find(folder, verb)?;
    folder.kept::<T>(part, 0, |_| Ok(())).map(|_| ())
}
