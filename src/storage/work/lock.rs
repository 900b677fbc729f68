//! One process at a time.

use super::{WorkError, WorkFolder};
use crate::storage::untrusted::check_file;
use std::fs::{File, OpenOptions, TryLockError};
use std::io;

const FILE: &str = "lock";

/// A folder of work that no other process may work on, until this is dropped or its process ends.
///
/// For work whose steps follow one another; numbered pieces need none.
#[derive(Debug)]
pub(crate) struct Lock {
    /// The system gives the lock back when the file is closed, however the process ends.
    _file: File,
}

impl WorkFolder {
    /// Keeps other processes out.
    ///
    /// A file system without locks keeps nobody out; two processes then do the same work, to the same bits.
    ///
    /// # Errors
    ///
    /// [`WorkError::Busy`] where another process is at work, [`WorkError::Io`].
    pub(crate) fn lock(&self) -> Result<Lock, WorkError> {
        let path = self.file(FILE);
        if path.symlink_metadata().is_ok() {
            check_file(&path).map_err(|error| WorkError::io(&path, error))?;
        }
        let mut options = OpenOptions::new();
        let file = (options.create(true).append(true).open(&path))
            .map_err(|error| WorkError::io(&path, error))?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => Err(WorkError::Busy {
                path: self.path().into(),
            }),
            Err(TryLockError::Error(error)) if error.kind() != io::ErrorKind::Unsupported => {
                Err(WorkError::io(&path, error))
            }
            _ => Ok(Lock { _file: file }),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::storage::work::{Manifest, WorkError, WorkFolder};

    #[test]
    fn the_second_is_kept_out_until_the_first_has_gone() {
        let place = tempfile::tempdir().unwrap();
        let manifest = Manifest::new("pretrain", 1);
        let open = || {
            let path = place.path().join("work");
            WorkFolder::open::<WorkError>(&path, &manifest, &[], |_| Ok(())).unwrap()
        };
        let first = open().lock().unwrap();
        let refused = open().lock().unwrap_err();
        assert!(matches!(refused, WorkError::Busy { .. }), "{refused}");
        drop(first);
        open().lock().unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn a_lock_that_leads_elsewhere_is_refused() {
        let place = tempfile::tempdir().unwrap();
        let manifest = Manifest::new("pretrain", 1);
        let path = place.path().join("work");
        let folder = WorkFolder::open::<WorkError>(&path, &manifest, &[], |_| Ok(())).unwrap();
        let elsewhere = place.path().join("elsewhere");
        std::os::unix::fs::symlink(&elsewhere, folder.file("lock")).unwrap();
        assert!(folder.lock().is_err());
        assert!(!elsewhere.exists());
    }
}
