//! A work folder that is not in its place yet.

use crate::storage::{NewFolder, StorageError};
use std::path::Path;

/// A new work folder, to which the call adds files before the folder appears.
pub(crate) struct NewWork<'a> {
    filling: NewFolder,
    place: &'a Path,
}

impl<'a> NewWork<'a> {
    /// Creates a folder for `place` with a folder for each of `parts`.
    pub(super) fn new(place: &'a Path, parts: &[&str]) -> Result<Self, StorageError> {
        let failed = |error| StorageError::io(place, error);
        let filling = NewFolder::new(place).map_err(failed)?;
        for part in parts {
            std::fs::create_dir(filling.file(part)).map_err(failed)?;
        }
        Ok(Self { filling, place })
    }

    /// Adds a file.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), StorageError> {
        std::fs::write(self.filling.file(name), bytes)
            .map_err(|error| StorageError::io(&self.place.join(name), error))
    }

    /// Moves the folder to its place, unless another process was faster.
    pub(super) fn finish(self) -> Result<(), StorageError> {
        use std::io::ErrorKind::{AlreadyExists, DirectoryNotEmpty};
        match self.filling.finish() {
            Err(error) if !matches!(error.kind(), AlreadyExists | DirectoryNotEmpty) => {
                Err(StorageError::io(self.place, error))
            }
            _ => Ok(()),
        }
    }
}
