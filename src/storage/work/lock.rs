//! Exclusive use of a work folder.

use super::WorkFolder;
use crate::storage::StorageError;
use crate::storage::untrusted::check_file;
use std::fs::{File, OpenOptions, TryLockError};
use std::io;

const FILE: &str = "lock";

/// Lock of a work folder, until this is dropped or its process ends. Numbered pieces need none.
#[derive(Debug)]
pub(crate) struct Lock {
    /// The system gives the lock back when the file is closed, however the process ends.
    _file: File,
}

impl WorkFolder {
    /// Keeps other processes out. On a file system without locks two processes may do the same work, to the same bits.
    pub(crate) fn lock(&self) -> Result<Lock, StorageError> {
        let path = self.file(FILE);
        if path.symlink_metadata().is_ok() {
            check_file(&path).map_err(|error| StorageError::io(&path, error))?;
        }
        let mut options = OpenOptions::new();
        let file = (options.create(true).append(true).open(&path))
            .map_err(|error| StorageError::io(&path, error))?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => Err(StorageError::Busy {
                path: self.path().into(),
            }),
            Err(TryLockError::Error(error)) if error.kind() != io::ErrorKind::Unsupported => {
                Err(StorageError::io(&path, error))
            }
            _ => Ok(Lock { _file: file }),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::storage::StorageError;
    use crate::storage::work::{Manifest, WorkFolder};

    #[test]
    fn the_second_is_kept_out_until_the_first_has_gone() {
        let place = tempfile::tempdir().unwrap();
        let manifest = Manifest::new("pretrain", 1);
        let open = || {
            let path = place.path().join("work");
            WorkFolder::open::<StorageError>(&path, &manifest, &[], |_| Ok(())).unwrap()
        };
        let first = open().lock().unwrap();
        let refused = open().lock().unwrap_err();
        assert!(matches!(refused, StorageError::Busy { .. }), "{refused}");
        drop(first);
        open().lock().unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn a_lock_that_leads_elsewhere_is_refused() {
        let place = tempfile::tempdir().unwrap();
        let manifest = Manifest::new("pretrain", 1);
        let path = place.path().join("work");
        let folder = WorkFolder::open::<StorageError>(&path, &manifest, &[], |_| Ok(())).unwrap();
        let elsewhere = place.path().join("elsewhere");
        std::os::unix::fs::symlink(&elsewhere, folder.file("lock")).unwrap();
        assert!(folder.lock().is_err());
        assert!(!elsewhere.exists());
    }
}
