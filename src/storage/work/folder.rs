//! A folder that keeps finished pieces of long work.

use super::manifest::{CHECKSUMS, Manifest};
use super::piece;
use crate::storage::files::{replace, write_new};
use crate::storage::names::is_unfinished;
use crate::storage::place::check_place;
use crate::storage::reading::{checksum_of_read, link_to_nothing};
use crate::storage::unfinished;
use crate::storage::untrusted::{check_file, check_folder, message, read_kept_text};
use crate::storage::{NewFolder, StorageError, sweep_beside};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::fs::{File, OpenOptions, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

const MANIFEST: &str = "manifest.json";
const LOCK: &str = "lock";
/// Longest file of a folder that is read whole, in bytes: the manifest of a bank of 10¹⁰ simulations is a tenth of it.
const MOST: u64 = 1 << 28;

/// A folder with the pieces of one call, which can be interrupted and resumed, also by several processes at once.
///
/// | file | holds |
/// |---|---|
/// | `manifest.json` | everything the pieces depend on; a call that differs is refused |
/// | `PART/0000.json`, … | one piece each, with its checksum; appears when it is complete |
/// | others | inputs of the work, and results made of the pieces |
#[derive(Debug, Clone)]
pub struct WorkFolder {
    path: PathBuf,
    /// Checksum of the manifest that the pieces depend on.
    identity: String,
}

impl WorkFolder {
    /// Resumes the folder of the same call; or makes it, with a folder for each of `parts` and the files that `fill` adds, whose checksums
    /// it returns for the manifest, if it has any.
    ///
    /// The folder appears complete. If several processes make it at once, one wins, and all continue with its folder.
    pub(crate) fn open<E: From<StorageError>>(
        path: &Path,
        manifest: &Manifest,
        parts: &[&str],
        fill: impl FnOnce(&NewFolder) -> Result<Option<Value>, E>,
    ) -> Result<Self, E> {
        if path.symlink_metadata().is_err() {
            check_place(path)?;
            let made = || -> Result<(), E> {
                let new = NewFolder::new(path)?;
                for part in parts {
                    std::fs::create_dir(new.file(part))
                        .map_err(|error| StorageError::io(path, error))?;
                }
                let mut manifest = manifest.clone();
                if let Some(checksums) = fill(&new)? {
                    manifest = manifest.with(CHECKSUMS, checksums);
                }
                new.write(MANIFEST, manifest.file_text())?;
                Ok(new.finish()?)
            };
            // Another process may have been faster.
            if let Err(error) = made()
                && !appears(path)
            {
                return Err(error);
            }
        }
        let opened = Self::resume(path, manifest)?;
        for part in parts {
            match std::fs::create_dir(opened.file(part)) {
                Err(error) if error.kind() != io::ErrorKind::AlreadyExists => {
                    return Err(StorageError::io(&opened.file(part), error).into());
                }
                _ => {}
            }
        }
        opened.sweep();
        Ok(opened)
    }

    /// Opens the folder of the same call.
    pub(crate) fn resume(path: &Path, manifest: &Manifest) -> Result<Self, StorageError> {
        let verb = manifest.verb();
        let path = path.to_owned();
        match read_manifest(&path, verb) {
            Err(reason) => Err(StorageError::Taken { path, verb, reason }),
            Ok(kept) => match manifest.differs(&kept) {
                None => Ok(Self::of(path, kept)),
                Some(difference) => Err(match manifest.is_of_version(&kept) {
                    true => StorageError::OtherCall { path, difference },
                    false => StorageError::OtherVersion { path, difference },
                }),
            },
        }
    }

    /// Opens the folder at a path, whatever call of `verb` made it.
    pub(crate) fn find(path: &Path, verb: &'static str) -> Result<(Self, Manifest), StorageError> {
        let path = path.to_owned();
        match read_manifest(&path, verb) {
            Ok(manifest) => Ok((Self::of(path, manifest.clone()), manifest)),
            Err(reason) => Err(StorageError::Foreign { path, verb, reason }),
        }
    }

    fn of(path: PathBuf, manifest: Manifest) -> Self {
        let identity = manifest.unfinished().checksum();
        Self { path, identity }
    }

    /// Path of the folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Path of a file of the folder.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Writes a result, in place of an earlier one.
    pub(crate) fn write(&self, name: &str, text: &str) -> Result<(), StorageError> {
        let path = self.file(name);
        replace(&path, text.as_bytes()).map_err(|error| StorageError::io(&path, error))
    }

    /// Removes the folder: the work is done, and its result is elsewhere.
    pub(crate) fn remove(self) -> Result<(), StorageError> {
        unfinished::remove(&self.path).map_err(|error| StorageError::io(&self.path, error))
    }

    /// Removes the folder if nothing is in `part`, the only one that it has.
    pub(crate) fn remove_bare(&self, part: &str) {
        if std::fs::remove_dir(self.file(part)).is_ok() {
            let _ = unfinished::remove(&self.path);
        }
    }

    /// Notes the checksum of a file of the folder, as it was read, in the manifest; where one is noted, refuses another file.
    pub(crate) fn seal(&self, name: &str, verb: &'static str) -> Result<(), StorageError> {
        let (_, manifest) = Self::find(&self.path, verb)?;
        let path = self.file(name);
        let read = checksum_of_read(&path);
        let mut sums = manifest.checksums().cloned().unwrap_or_else(|| json!({}));
        match sums.get(name).and_then(Value::as_str) {
            Some(noted) if Some(noted) == read.as_deref() => Ok(()),
            Some(_) => Err(StorageError::Piece {
                path,
                reason: "its bytes are not those that this folder was made with".into(),
            }),
            None => {
                sums[name] = json!(read);
                self.finish(&manifest, sums)
            }
        }
    }

    /// Adds the checksums of all pieces to the manifest: the work is finished.
    pub(crate) fn finish(&self, manifest: &Manifest, checksums: Value) -> Result<(), StorageError> {
        self.write(
            MANIFEST,
            &manifest.clone().with(CHECKSUMS, checksums).file_text(),
        )
    }

    /// Reads a file of the folder as text.
    pub(crate) fn read(&self, name: &str) -> Result<String, StorageError> {
        let path = self.file(name);
        read_kept_text(&path, MOST).map_err(|error| StorageError::kept(&path, error))
    }

    /// Returns the path of a part; a link out of the folder is refused.
    pub(crate) fn part(&self, part: &str) -> Result<PathBuf, StorageError> {
        let path = self.file(part);
        check_folder(&path).map_err(|error| StorageError::kept(&path, error))?;
        Ok(path)
    }

    fn piece(&self, part: &str, number: usize) -> Result<PathBuf, StorageError> {
        Ok(self.part(part)?.join(format!("{number:04}.json")))
    }

    /// Reads piece `number` of a part, if it was kept; `fits` refuses a wrong one with a reason.
    pub(crate) fn kept<T: DeserializeOwned>(
        &self,
        part: &str,
        number: usize,
        fits: impl FnOnce(&T) -> Result<(), &'static str>,
    ) -> Result<Option<T>, StorageError> {
        let path = self.piece(part, number)?;
        let text = match read_kept_text(&path, MOST) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(StorageError::io(&path, error)),
        };
        let wrong = |reason: String| StorageError::Piece {
            path: path.clone(),
            reason: message(&reason),
        };
        let piece: T = piece::parse(&text, &self.identity).map_err(wrong)?;
        fits(&piece).map_err(|reason| wrong(reason.into()))?;
        Ok(Some(piece))
    }

    /// Keeps piece `number` of a part; one that another process has kept meanwhile stays.
    pub(crate) fn keep<T: Serialize>(
        &self,
        part: &str,
        number: usize,
        piece: &T,
    ) -> Result<(), StorageError> {
        let path = self.piece(part, number)?;
        let written = piece::text(piece, &self.identity)
            .map_err(io::Error::from)
            .and_then(|text| write_new(&path, text.as_bytes()));
        match written {
            Err(error) if !path.exists() => Err(StorageError::io(&path, error)),
            _ => Ok(()),
        }
    }

    /// Keeps other processes out until the file is dropped, or its process ends. Numbered pieces need no lock. On a file system
    /// without locks two processes may do the same work, to the same bits.
    pub(crate) fn lock(&self) -> Result<File, StorageError> {
        let path = self.file(LOCK);
        let failed = |error| StorageError::io(&path, error);
        if path.symlink_metadata().is_ok() {
            check_file(&path).map_err(failed)?;
        }
        let mut options = OpenOptions::new();
        let file = (options.create(true).append(true).open(&path)).map_err(failed)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => Err(StorageError::Busy(self.path.clone())),
            Err(TryLockError::Error(error)) if error.kind() != io::ErrorKind::Unsupported => {
                Err(failed(error))
            }
            _ => Ok(file),
        }
    }

    /// Removes leftovers of killed processes beside the folder, in it and in its parts.
    pub(crate) fn sweep(&self) {
        sweep_beside(&self.path);
        unfinished::sweep(&self.path);
        for entry in self.path.read_dir().into_iter().flatten().flatten() {
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                unfinished::sweep(&entry.path());
            }
        }
    }
}

/// Returns whether a folder of work has anything that is finished: a file other than those that it begins with.
pub(crate) fn has_pieces(folder: &Path) -> bool {
    let entries = folder.read_dir().into_iter().flatten().flatten();
    let is_piece = |entry: std::fs::DirEntry| match entry.file_type() {
        Ok(kind) if kind.is_dir() => has_pieces(&entry.path()),
        Ok(_) => {
            let name = entry.file_name();
            !name
                .to_str()
                .is_some_and(|name| [MANIFEST, LOCK].contains(&name) || is_unfinished(name))
        }
        Err(_) => false,
    };
    entries.into_iter().any(is_piece)
}

/// Reads the manifest of a folder of `verb`; else the reason why it has none, in words.
fn read_manifest(path: &Path, verb: &'static str) -> Result<Manifest, String> {
    match path.symlink_metadata() {
        _ if path.is_dir() => {}
        Ok(_) => return Err(link_to_nothing(path).unwrap_or_else(|| "it is no folder".into())),
        Err(_) => return Err("it does not exist".into()),
    }
    let text = read_kept_text(&path.join(MANIFEST), MOST).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => "it has no manifest.json".into(),
        _ => format!("its manifest.json: {error}"),
    })?;
    Manifest::parse(verb, &text)
}

/// Returns whether another process makes the folder within a moment: it may have swept this one's unfinished folder away, which had
/// not yet been locked.
fn appears(path: &Path) -> bool {
    (0..20).any(|_| {
        let there = path.symlink_metadata().is_ok();
        if !there {
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
        there
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::reading::Reading;
    use std::fs;

    fn manifest(runs: u32) -> Manifest {
        Manifest::new("reproduce", 1).with("runs", runs)
    }

    fn open(path: &Path, runs: u32) -> Result<WorkFolder, StorageError> {
        WorkFolder::open(path, &manifest(runs), &["runs"], |new| {
            new.write("start.txt", b"a").map(|()| None)
        })
    }

    /// A file that pieces depend on is that of the folder, in every call.
    #[test]
    fn a_sealed_file_that_was_replaced_is_refused() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("work");
        let folder = open(&path, 2).unwrap();
        assert!(has_pieces(&path), "the file that it was filled with");
        let read = |folder: &WorkFolder| {
            let mut reading = Reading::open(&folder.file("start.txt")).unwrap();
            io::copy(&mut reading, &mut io::sink()).unwrap();
            folder.seal("start.txt", "reproduce")
        };
        read(&folder).unwrap();
        read(&open(&path, 2).unwrap()).unwrap();
        fs::write(path.join("start.txt"), "b").unwrap();
        let error = read(&open(&path, 2).unwrap()).unwrap_err().to_string();
        assert!(
            error.contains("start.txt") && error.contains("remove it"),
            "{error}"
        );
    }

    #[test]
    fn pieces_are_kept_whole_and_found_again() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("work");
        let folder = open(&path, 2).unwrap();
        let piece = |x: f64| json!({ "number": 1, "x": x });
        let any = |_: &Value| Ok(());
        assert_eq!(folder.kept("runs", 1, any).unwrap(), None);
        folder.keep("runs", 1, &piece(0.1)).unwrap();
        folder.keep("runs", 1, &piece(3.0)).unwrap();
        let again = open(&path, 2).unwrap();
        assert_eq!(again.kept("runs", 1, any).unwrap(), Some(piece(0.1)));
        let refused = |_: &Value| Err("it is odd");
        let error = again.kept("runs", 1, refused).unwrap_err().to_string();
        assert!(
            error.contains("0001.json") && error.contains("it is odd"),
            "{error}"
        );
        let file = path.join("runs/0001.json");
        fs::write(&file, "[1, ").unwrap();
        let error = again.kept("runs", 1, any).unwrap_err().to_string();
        assert!(error.contains("remove it"), "{error}");
    }

    /// No call of this version can go on with it: the message asks for none.
    #[test]
    fn work_of_another_layout_is_not_to_be_resumed() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("work");
        open(&path, 2).unwrap();
        let refused = |manifest| WorkFolder::resume(&path, &manifest).unwrap_err();
        let of_call = refused(manifest(3));
        let of_version = refused(Manifest::new("reproduce", 2).with("runs", 3));
        assert!(
            matches!(of_call, StorageError::OtherCall { .. }),
            "{of_call}"
        );
        assert!(
            matches!(of_version, StorageError::OtherVersion { .. }),
            "{of_version}"
        );
    }

    /// Another number in a piece, or a piece of another folder, is refused by name.
    #[test]
    fn altered_and_foreign_pieces_are_refused() {
        let place = tempfile::tempdir().unwrap();
        let [ours, theirs] = [(2, "ours"), (3, "theirs")]
            .map(|(runs, name)| open(&place.path().join(name), runs).unwrap());
        let any = |_: &Value| Ok(());
        let refused = || {
            let error = ours.kept("runs", 0, any).unwrap_err().to_string();
            assert!(
                error.contains("runs/0000.json") && error.contains("remove it"),
                "{error}"
            );
            error
        };
        for folder in [&ours, &theirs] {
            folder
                .keep("runs", 0, &json!({ "x": 0.1, "verdict": "no-gap" }))
                .unwrap();
        }
        let file = ours.file("runs/0000.json");
        let text = fs::read_to_string(&file).unwrap();
        fs::write(&file, text.replace("no-gap", "structural-gap")).unwrap();
        assert!(refused().contains("does not match its checksum"));
        fs::copy(theirs.file("runs/0000.json"), &file).unwrap();
        assert!(refused().contains("does not match its checksum"));
        fs::write(&file, "{ \"x\": 0.1 }").unwrap();
        assert!(refused().contains("it has no checksum"));
        fs::write(&file, text).unwrap();
        assert!(ours.kept("runs", 0, any).unwrap().is_some());
    }

    #[cfg(unix)]
    #[test]
    fn leftovers_of_killed_processes_are_removed_when_the_folder_is_opened() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("work");
        open(&path, 2).unwrap();
        let name = ".truetwin-unfinished-4194305-a1B2c3";
        let left = [place.path().join(name), path.join(name)];
        let in_part = path.join("runs").join(name);
        for file in left.iter().chain([&in_part]) {
            fs::write(file, "half").unwrap();
        }
        open(&path, 2).unwrap();
        assert!(!left[0].exists() && !left[1].exists() && !in_part.exists());
        open(&path, 2).unwrap().remove().unwrap();
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 0);
    }

    #[test]
    fn other_folders_are_refused_and_nothing_is_left_over() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("work");
        open(&path, 2).unwrap();
        let refused = |path: &Path, runs| open(path, runs).unwrap_err().to_string();
        assert!(refused(&path, 3).contains("runs was 2, now it is 3"));
        assert!(refused(place.path(), 2).contains("no reproduce folder"));
        assert!(refused(&place.path().join("a/b"), 2).contains("make it first"));
        let failed: Result<_, StorageError> =
            WorkFolder::open(&place.path().join("new"), &manifest(1), &[], |_| {
                Err(StorageError::io(Path::new("x"), io::Error::other("full")))
            });
        assert!(failed.is_err());
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 1);
    }

    /// Many processes begin at once: all end up in one folder.
    #[test]
    fn who_comes_second_goes_on_with_the_folder_of_the_first() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("work");
        std::thread::scope(|scope| {
            let all: Vec<_> = (0..8).map(|_| scope.spawn(|| open(&path, 2))).collect();
            for one in all {
                one.join().unwrap().unwrap();
            }
        });
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 1);
        assert_eq!(fs::read_to_string(path.join("start.txt")).unwrap(), "a");
    }

    #[test]
    fn the_second_is_kept_out_until_the_first_has_gone() {
        let place = tempfile::tempdir().unwrap();
        let manifest = Manifest::new("pretrain", 1);
        let open = || {
            let path = place.path().join("work");
            WorkFolder::open::<StorageError>(&path, &manifest, &[], |_| Ok(None)).unwrap()
        };
        let first = open().lock().unwrap();
        let refused = open().lock().unwrap_err();
        assert!(matches!(refused, StorageError::Busy(_)), "{refused}");
        drop(first);
        open().lock().unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn a_lock_that_leads_elsewhere_is_refused() {
        let place = tempfile::tempdir().unwrap();
        let manifest = Manifest::new("pretrain", 1);
        let path = place.path().join("work");
        let folder = WorkFolder::open::<StorageError>(&path, &manifest, &[], |_| Ok(None)).unwrap();
        let elsewhere = place.path().join("elsewhere");
        std::os::unix::fs::symlink(&elsewhere, folder.file("lock")).unwrap();
        assert!(folder.lock().is_err());
        assert!(!elsewhere.exists());
    }
}
