//! Readers of work folders for the fuzz tests. Not part of the library's interface.

use super::StorageError;
use super::work::WorkFolder;
use std::path::Path;

/// Reads the manifest of a folder that `verb` is said to have made.
pub fn manifest(folder: &Path, verb: &'static str) -> Result<(), StorageError> {
    WorkFolder::find(folder, verb).map(|_| ())
}
