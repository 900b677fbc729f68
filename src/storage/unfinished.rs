//! Files and folders that are not in their place yet, and the removal of those that a killed process left behind.
//!
//! An unfinished file or folder is called `.truetwin-…`. Its writer holds a lock on it, which the system releases when the
//! process ends. Whatever can be locked is therefore abandoned. A writer checks after locking that nobody has removed its
//! file in between, so that no writer loses a file. On file systems without locks nothing is removed.

use super::StorageError;
use super::error::folder;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use tempfile::{Builder, NamedTempFile, TempDir};

/// Start of the names of unfinished files and folders.
const PREFIX: &str = ".truetwin-";

/// Creates a locked temporary file beside `path`.
pub(super) fn file_beside(path: &Path) -> io::Result<NamedTempFile> {
    let mut builder = Builder::new();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // As any new file: the user's mask decides who may read it.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    loop {
        let file = builder.prefix(PREFIX).tempfile_in(folder(path));
        let file = file.map_err(without_path)?;
        if holds(file.as_file(), file.path()) {
            return Ok(file);
        }
    }
}

/// An error without the name of a temporary file.
fn without_path(error: io::Error) -> io::Error {
    match error.get_ref() {
        Some(_) => error.kind().into(),
        None => error,
    }
}

/// Locks a new file or folder; `false` if a sweep of another process has removed it.
fn holds(file: &File, path: &Path) -> bool {
    match file.try_lock() {
        Ok(()) => is_same(file, path),
        Err(TryLockError::WouldBlock) => false,
        // Without locks nobody sweeps.
        Err(TryLockError::Error(_)) => true,
    }
}

#[cfg(unix)]
fn is_same(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let id = |data: fs::Metadata| (data.dev(), data.ino());
    (file.metadata().ok().map(id)).is_some_and(|ours| path.metadata().ok().map(id) == Some(ours))
}

#[cfg(not(unix))]
fn is_same(_: &File, path: &Path) -> bool {
    path.exists()
}

/// Removes the unfinished files and folders in `place` whose writers have died. Those that cannot be removed stay.
pub(super) fn sweep(place: &Path) {
    let Ok(entries) = fs::read_dir(place) else {
        return;
    };
    for entry in entries.flatten() {
        if entry.file_name().to_string_lossy().starts_with(PREFIX) {
            remove_abandoned(&entry.path());
        }
    }
}

/// Removes leftovers beside an output.
pub(crate) fn sweep_beside(path: &Path) {
    sweep(folder(path));
}

fn remove_abandoned(path: &Path) {
    // A link or a pipe is none of ours, and opening it may have effects.
    let Ok(data) = path.symlink_metadata() else {
        return;
    };
    if !data.is_file() && !data.is_dir() {
        return;
    }
    let Ok(file) = File::open(path) else { return };
    // The path may be another's since it was opened.
    if file.try_lock().is_ok() && is_same(&file, path) {
        let _ = if data.is_dir() {
            fs::remove_dir_all(path)
        } else {
            fs::remove_file(path)
        };
    }
}

/// Removes a folder at once from its place, then from the disk; a sweep ends an interrupted removal.
pub(super) fn remove(place: &Path) -> io::Result<()> {
    let gone = named(place);
    fs::rename(place, &gone)?;
    match fs::remove_dir_all(&gone) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

fn named(place: &Path) -> PathBuf {
    let name = place.file_name().unwrap_or_default().to_string_lossy();
    place.with_file_name(format!("{PREFIX}{name}"))
}

/// A folder that is filled beside its place and appears there complete.
#[derive(Debug)]
pub(crate) struct NewFolder {
    place: PathBuf,
    filling: TempDir,
    /// Its lock keeps sweeps away.
    _open: Option<File>,
}

impl NewFolder {
    /// Creates a folder for `place`. Several processes may do so at once; the first to finish wins.
    pub fn new(place: &Path) -> Result<Self, StorageError> {
        Self::made(place, Builder::new().prefix(PREFIX))
    }

    /// Creates the folder for `place` that one process at a time may have.
    pub fn claim(place: &Path) -> Result<Self, StorageError> {
        let path = named(place);
        let name = path.file_name().unwrap_or_default();
        Self::made(place, Builder::new().prefix(name).rand_bytes(0))
    }

    fn made(place: &Path, name: &Builder<'_, '_>) -> Result<Self, StorageError> {
        loop {
            sweep_beside(place);
            let filling = name.tempdir_in(folder(place));
            let filling = filling.map_err(|error| match error.kind() {
                io::ErrorKind::AlreadyExists => StorageError::Busy(place.into()),
                _ => StorageError::io(place, without_path(error)),
            })?;
            if let Some(new) = Self::locked(place, filling) {
                return Ok(new);
            }
        }
    }

    fn locked(place: &Path, filling: TempDir) -> Option<Self> {
        let open = File::open(filling.path()).ok();
        let is_lost = match &open {
            Some(file) => !holds(file, filling.path()),
            None => !filling.path().exists(),
        };
        if is_lost {
            // Removed by a sweep; the name may be another process's by now.
            let _ = filling.keep();
            return None;
        }
        Some(Self {
            place: place.into(),
            filling,
            _open: open,
        })
    }

    /// Path of a file of the folder until it is finished.
    pub fn file(&self, name: &str) -> PathBuf {
        self.filling.path().join(name)
    }

    /// Adds a file.
    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> Result<(), StorageError> {
        fs::write(self.file(name), bytes)
            .map_err(|error| StorageError::io(&self.place.join(name), error))
    }

    /// Moves the folder to its place.
    pub fn finish(self) -> Result<(), StorageError> {
        let failed = |error| StorageError::io(&self.place, error);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // A temporary folder is private; a result is like any other folder.
            let mode = fs::Permissions::from_mode(0o755);
            fs::set_permissions(self.filling.path(), mode).map_err(failed)?;
        }
        fs::rename(self.filling.path(), &self.place).map_err(failed)?;
        // Moved away: nothing is left to remove.
        let _ = self.filling.keep();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(place: &Path) -> Vec<String> {
        let entries = fs::read_dir(place).unwrap();
        let mut names: Vec<String> = entries
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    /// Between the creation of a folder and its lock, a sweep may take it.
    #[test]
    fn a_new_folder_that_a_sweep_took_is_none() {
        let place = tempfile::tempdir().unwrap();
        let taken = tempfile::tempdir_in(place.path()).unwrap();
        fs::remove_dir(taken.path()).unwrap();
        assert!(NewFolder::locked(&place.path().join("out"), taken).is_none());
    }

    #[test]
    fn a_folder_appears_when_it_is_finished() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("out");
        let dropped = NewFolder::new(&path).unwrap();
        fs::write(dropped.file("a.txt"), "a").unwrap();
        drop(dropped);
        assert!(names(place.path()).is_empty());
        let folder = NewFolder::new(&path).unwrap();
        fs::write(folder.file("a.txt"), "a").unwrap();
        assert!(!path.exists());
        folder.finish().unwrap();
        assert_eq!(fs::read(path.join("a.txt")).unwrap(), b"a");
        assert_eq!(names(place.path()), ["out"]);
    }

    #[test]
    fn one_process_claims_a_place() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("out");
        let first = NewFolder::claim(&path).unwrap();
        let error = NewFolder::claim(&path).unwrap_err();
        assert!(matches!(error, StorageError::Busy(_)), "{error}");
        drop(first);
        NewFolder::claim(&path).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn leftovers_of_the_dead_are_swept_and_the_work_of_the_living_is_not() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        fs::create_dir_all(at(".truetwin-old/part")).unwrap();
        fs::write(at(".truetwin-abc"), "half").unwrap();
        fs::write(at("user.txt"), "mine").unwrap();
        std::os::unix::fs::symlink(at("user.txt"), at(".truetwin-link")).unwrap();
        let folder = NewFolder::new(&at("out")).unwrap();
        let file = file_beside(&at("out.txt")).unwrap();
        sweep(place.path());
        assert!(folder.file("").exists() && file.path().exists());
        drop((folder, file));
        assert_eq!(names(place.path()), [".truetwin-link", "user.txt"]);
    }

    /// Writers and sweepers at once: no writer loses its file.
    #[test]
    fn sweeps_take_nothing_from_writers() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("out");
        std::thread::scope(|scope| {
            for _ in 0..3 {
                scope.spawn(|| (0..200).for_each(|_| sweep(place.path())));
                scope.spawn(|| {
                    for _ in 0..200 {
                        file_beside(&path).unwrap().persist(&path).unwrap();
                    }
                });
            }
        });
        assert_eq!(names(place.path()), ["out"]);
    }
}
