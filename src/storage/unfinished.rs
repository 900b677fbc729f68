//! Files and folders that are not in their place yet, and the removal of those that a killed process left behind.
//!
//! An unfinished file or folder is called `.truetwin-unfinished-PROCESS-RANDOM`, one that a single process may have
//! `.truetwin-unfinished-CHECKSUM`, by the name of its place. Its writer holds a lock on it, which the system releases when the
//! process ends. What has such a name and can be locked is therefore abandoned; other names are a user's. A writer checks after
//! locking that nobody has removed its file in between, so that no writer loses a file. On file systems without locks nothing is removed.

use super::StorageError;
use super::error::folder;
use super::names::{is_of_another, is_unfinished, named, places_beside, prefix};
use std::collections::BTreeSet;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use tempfile::{Builder, NamedTempFile, TempDir};

/// Unfinished files and folders of this process, which are removed where it ends without unwinding. Held while one is made, moved or removed.
static MADE: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// First result of this process that is in its place.
static RESULT: OnceLock<PathBuf> = OnceLock::new();

/// The first result of this process that is in its place: work that is stopped afterwards has lost nothing.
pub(crate) fn result() -> Option<&'static Path> {
    RESULT.get().map(PathBuf::as_path)
}

/// Notes a result that is in its place.
pub(super) fn note_result(place: &Path) {
    let _ = RESULT.set(place.into());
}

fn made_here() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    MADE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes what this process has not finished. The process ends now: no thread makes, moves or removes a file or folder afterwards.
pub(crate) fn remove_unfinished() {
    let made = made_here();
    for path in made.iter() {
        let _ = fs::remove_dir_all(path).or_else(|_| fs::remove_file(path));
    }
    std::mem::forget(made);
}

/// A file or folder among the unfinished ones of this process, until it is dropped or moved.
#[derive(Debug)]
pub(super) struct Unfinished<T: AsRef<Path>>(Option<T>);

impl<T: AsRef<Path>> Unfinished<T> {
    fn new(make: impl FnOnce() -> io::Result<T>) -> io::Result<Self> {
        let mut made = made_here();
        let new = make()?;
        made.insert(new.as_ref().into());
        Ok(Self(Some(new)))
    }

    pub(super) fn get(&self) -> &T {
        self.0.as_ref().expect("neither dropped nor moved")
    }

    fn path(&self) -> &Path {
        self.get().as_ref()
    }

    /// Lets `to` move it.
    pub(super) fn moved<R>(mut self, to: impl FnOnce(T) -> R) -> R {
        let mut made = made_here();
        made.remove(self.path());
        to(self.0.take().expect("neither dropped nor moved"))
    }
}

impl<T: AsRef<Path>> Drop for Unfinished<T> {
    fn drop(&mut self) {
        let Some(one) = self.0.take() else { return };
        let mut made = made_here();
        made.remove(one.as_ref());
        drop(one);
    }
}

/// Creates a locked temporary file beside `path`.
pub(super) fn file_beside(path: &Path) -> io::Result<Unfinished<NamedTempFile>> {
    let mut builder = Builder::new();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // As any new file: the user's mask decides who may read it.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    let prefix = prefix();
    builder.prefix(&prefix);
    loop {
        let file = Unfinished::new(|| builder.tempfile_in(folder(path)));
        let file = file.map_err(without_path)?;
        if holds(file.get().as_file(), file.path()) {
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
        let name = entry.file_name();
        let is_ours = |name: &str| is_unfinished(name) && !is_of_another(name);
        if name.to_str().is_some_and(is_ours) {
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
    match fs::remove_dir_all(&gone).or_else(|_| remove_one_by_one(&gone)) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Removes a folder with one open file at a time, where the system allows no more.
fn remove_one_by_one(folder: &Path) -> io::Result<()> {
    let mut folders = vec![folder.to_owned()];
    let mut next = 0;
    while let Some(folder) = folders.get(next).cloned() {
        let entries: Vec<_> = fs::read_dir(&folder)?.collect::<io::Result<_>>()?;
        for entry in entries {
            match entry.file_type()?.is_dir() {
                true => folders.push(entry.path()),
                false => fs::remove_file(entry.path())?,
            }
        }
        next += 1;
    }
    folders.iter().rev().try_for_each(fs::remove_dir)
}

/// The error of a folder for `place` that one process may have, where its name is taken.
fn taken(place: &Path) -> StorageError {
    let path = named(place);
    let is_folder = path.symlink_metadata().is_ok_and(|data| data.is_dir());
    match is_folder {
        true => StorageError::Busy(place.into()),
        false => StorageError::InTheWay(path),
    }
}

/// A folder that is filled beside its place and appears there complete.
#[derive(Debug)]
pub(crate) struct NewFolder {
    place: PathBuf,
    /// `true` where no other process may fill the place.
    is_claimed: bool,
    filling: Unfinished<TempDir>,
    /// Its lock keeps sweeps away.
    _open: Option<File>,
}

impl NewFolder {
    /// Creates a folder for `place`. Several processes may do so at once; the first to finish wins.
    pub fn new(place: &Path) -> Result<Self, StorageError> {
        Self::made(place, false, Builder::new().prefix(&prefix()))
    }

    /// Creates the folder for `place` that one process at a time may have.
    pub fn claim(place: &Path) -> Result<Self, StorageError> {
        let path = named(place);
        let name = path.file_name().unwrap_or_default();
        Self::made(place, true, Builder::new().prefix(name).rand_bytes(0))
    }

    fn made(place: &Path, is_claimed: bool, name: &Builder<'_, '_>) -> Result<Self, StorageError> {
        // `out/.` is `out`.
        let place: &Path = &place.components().collect::<PathBuf>();
        loop {
            sweep_beside(place);
            let filling = Unfinished::new(|| name.tempdir_in(folder(place)));
            let filling = filling.map_err(|error| match error.kind() {
                io::ErrorKind::AlreadyExists => taken(place),
                _ => StorageError::io(place, without_path(error)),
            })?;
            if let Some(new) = Self::locked(place, filling) {
                return Ok(Self { is_claimed, ..new });
            }
        }
    }

    fn locked(place: &Path, filling: Unfinished<TempDir>) -> Option<Self> {
        let open = File::open(filling.path()).ok();
        let is_lost = match &open {
            Some(file) => !holds(file, filling.path()),
            None => !filling.path().exists(),
        };
        if is_lost {
            // Removed by a sweep; the name may be another process's by now.
            let _ = filling.moved(TempDir::keep);
            return None;
        }
        Some(Self {
            place: place.into(),
            is_claimed: false,
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

    /// Moves the folder to its place. One that was claimed is kept beside a place that was taken meanwhile.
    pub fn finish(self) -> Result<(), StorageError> {
        let Self {
            place,
            is_claimed,
            filling,
            ..
        } = self;
        let failed = |error| StorageError::io(&place, error);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // A temporary folder is private; a result is like any other folder.
            let mode = fs::Permissions::from_mode(0o755);
            fs::set_permissions(filling.path(), mode).map_err(failed)?;
        }
        let kept = filling.moved(|from| {
            let kept = match fs::rename(&from, &place) {
                Err(error) if is_claimed => kept_beside(from.path(), &place).ok_or(error).map(Some),
                moved => moved.map(|()| None),
            }?;
            // Moved away: nothing is left to remove.
            let _ = from.keep();
            Ok(kept)
        });
        match kept.map_err(failed)? {
            None => {
                if is_claimed {
                    note_result(&place);
                }
                Ok(())
            }
            Some(kept) => {
                note_result(&kept);
                Err(StorageError::Kept { place, kept })
            }
        }
    }
}

/// Moves a folder to the first free place beside one that is taken.
fn kept_beside(folder: &Path, place: &Path) -> Option<PathBuf> {
    let is_moved =
        |path: &PathBuf| path.symlink_metadata().is_err() && fs::rename(folder, path).is_ok();
    places_beside(place).find(is_moved)
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
        let out = place.path().join("out");
        let taken = Unfinished::new(|| tempfile::tempdir_in(place.path())).unwrap();
        fs::remove_dir(taken.path()).unwrap();
        assert!(NewFolder::locked(&out, taken).is_none());
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
        let old = named(&at("old"));
        fs::create_dir_all(old.join("part")).unwrap();
        fs::write(at(".truetwin-unfinished-4711-a1B2c3"), "half").unwrap();
        fs::write(at("user.txt"), "mine").unwrap();
        let link = ".truetwin-unfinished-0123456789abcdef";
        std::os::unix::fs::symlink(at("user.txt"), at(link)).unwrap();
        let folder = NewFolder::new(&at("out")).unwrap();
        let file = file_beside(&at("out.txt")).unwrap();
        sweep(place.path());
        assert!(folder.file("").exists() && file.path().exists());
        drop((folder, file));
        assert_eq!(names(place.path()), [link, "user.txt"]);
    }

    /// A name that begins as ours do is a user's, unless it names a process or a place.
    #[test]
    fn files_of_users_are_not_swept() {
        let place = tempfile::tempdir().unwrap();
        let users = [
            ".truetwin-cache",
            ".truetwin-study.toml",
            ".truetwin-unfinished",
            ".truetwin-unfinished-4711",
            ".truetwin-unfinished-mine-a1B2c3",
            ".truetwin-unfinished-notes.txt",
        ];
        for name in users {
            fs::write(place.path().join(name), "mine").unwrap();
        }
        NewFolder::new(&place.path().join("out")).unwrap();
        assert_eq!(names(place.path()), users);
    }

    #[test]
    fn a_folder_goes_one_by_one() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("work");
        fs::create_dir_all(path.join("a/b")).unwrap();
        fs::create_dir_all(path.join("c")).unwrap();
        fs::write(path.join("a/b/x"), "x").unwrap();
        fs::write(path.join("y"), "y").unwrap();
        remove_one_by_one(&path).unwrap();
        assert!(names(place.path()).is_empty());
    }

    #[cfg(unix)]
    #[test]
    fn what_stands_in_the_way_is_named() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("out");
        std::os::unix::fs::symlink("/nowhere", named(&path)).unwrap();
        let error = NewFolder::claim(&path).unwrap_err();
        assert!(matches!(error, StorageError::InTheWay(_)), "{error}");
    }

    /// A place that was taken meanwhile does not cost the result.
    #[test]
    fn a_finished_folder_is_kept_beside_a_taken_place() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("out");
        let folder = NewFolder::claim(&path.join(".")).unwrap();
        folder.write("a.txt", "a").unwrap();
        fs::write(&path, "another's").unwrap();
        let error = folder.finish().unwrap_err().to_string();
        assert!(error.contains("out-2"), "{error}");
        assert_eq!(names(place.path()), ["out", "out-2"]);
        assert_eq!(fs::read(place.path().join("out-2/a.txt")).unwrap(), b"a");
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
                        file_beside(&path)
                            .unwrap()
                            .moved(|file| file.persist(&path))
                            .unwrap();
                    }
                });
            }
        });
        assert_eq!(names(place.path()), ["out"]);
    }
}
