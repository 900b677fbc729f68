//! A folder that keeps finished pieces of long work.

use super::Manifest;
use crate::storage::files::{NewFolder, PREFIX, folder, replace, sweep, with_remedy, write_new};
use crate::storage::untrusted::{MESSAGE, check_folder, one_line, read_kept_text};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::io;
use std::path::{Path, PathBuf};

const MANIFEST: &str = "manifest.json";
/// Longest file of a folder that is read whole, in bytes: the manifest of a bank of 10¹⁰ simulations is a tenth of it.
const MOST: u64 = 1 << 28;

/// A folder with the pieces of one call, which can be interrupted and gone on with, also by several processes at once.
///
/// | file | holds |
/// |---|---|
/// | `manifest.json` | what the pieces depend on; another call that differs is refused |
/// | `PART/0000.json`, … | a piece each; appears whole when it is done |
/// | anything else | what the work starts from, and results made of the pieces |
///
/// ```
/// use truetwin::evaluate::paper::{Benchmark, MonteCarlo, Origin, Scenario, reference_projects};
/// use truetwin::estimator::PretrainOptions;
/// use truetwin::storage::work::{WorkError, WorkFolder};
///
/// let project = &reference_projects()?[0];
/// let study = project.study();
/// let place = tempfile::tempdir()?;
/// let training = PretrainOptions::default();
/// let open = |seed| -> Result<WorkFolder, _> {
///     let plan = MonteCarlo { benchmark: Benchmark::of(study), scenario: Scenario::First, runs: 10, seed };
///     plan.folder(&place.path().join("runs"), study, Origin::Trained(&training))
/// };
/// open(1)?;
/// open(1)?; // the same call goes on
/// let error: WorkError = open(2).err().ok_or("another call is refused")?;
/// assert!(error.to_string().contains("seed"), "{error}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct WorkFolder {
    path: PathBuf,
}

/// Why a folder of work cannot be used.
///
/// ```
/// use truetwin::progress::Progress;
/// use truetwin::estimator::{EstimatorError, shards::BankPlan};
/// use truetwin::estimator::PresetName;
/// use truetwin::study::{RecordPlan, Study};
/// use truetwin::twins::VanDerPol;
/// use truetwin::storage::work::{Share, WorkError};
///
/// let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 100))?;
/// let plan = BankPlan { project: study.into(), preset: PresetName::Paper, size: 10, seed: 1 };
/// let error = plan.fill("no/such/place".as_ref(), Share::WHOLE, &Progress::silent()).unwrap_err();
/// let of_the_folder: Option<&WorkError> = match &error {
///     EstimatorError::Work(error) => Some(error),
///     _ => None,
/// };
/// assert!(of_the_folder.is_some(), "{error}");
/// # Ok::<(), truetwin::study::StudyError>(())
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WorkError {
    /// Something cannot be read or written.
    #[error("{}: {}", path.display(), with_remedy(error))]
    Io {
        /// File or folder.
        path: PathBuf,
        /// What the system said.
        error: io::Error,
    },
    /// There is no place for it.
    #[error("{}: the folder {} does not exist; make it first", path.display(), folder(path).display())]
    Place {
        /// Folder.
        path: PathBuf,
    },
    /// The path is taken by something else.
    #[error(
        "{} exists already and is no folder of `{verb}`; choose another --out, or remove it",
        path.display()
    )]
    Foreign {
        /// Folder.
        path: PathBuf,
        /// What was to go on with it.
        verb: &'static str,
    },
    /// The folder is of another call.
    #[error(
        "{} holds the work of another call: {difference}; repeat that call to go on with it, choose another --out, or remove it",
        path.display()
    )]
    Other {
        /// Folder.
        path: PathBuf,
        /// What is different.
        difference: String,
    },
    /// Another process has the folder.
    #[error("{}: another process is at work on it; wait until it is done, or stop it", path.display())]
    Busy {
        /// Folder.
        path: PathBuf,
    },
    /// A piece that this work did not make.
    #[error("{}: cannot be used ({reason}); remove it, and it is made again", path.display())]
    Piece {
        /// File.
        path: PathBuf,
        /// What does not fit.
        reason: String,
    },
}

impl WorkError {
    /// What the system said about a path.
    pub fn io(path: &Path, error: io::Error) -> Self {
        Self::Io {
            path: path.into(),
            error,
        }
    }
}

/// A folder of work that is not in its place yet.
pub(crate) struct NewWork<'a> {
    filling: NewFolder,
    place: &'a Path,
}

impl NewWork<'_> {
    /// Adds a file that the work starts from.
    ///
    /// # Errors
    ///
    /// [`WorkError::Io`].
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), WorkError> {
        std::fs::write(self.filling.file(name), bytes)
            .map_err(|error| WorkError::io(&self.place.join(name), error))
    }
}

impl WorkFolder {
    /// Goes on with the folder that the same call made; or makes it, with a folder for each of `parts` and what `fill` adds.
    ///
    /// The folder appears whole. Of several processes that make it at once, one wins, and all go on with its folder.
    ///
    /// # Errors
    ///
    /// [`WorkError`]: a path that is taken, a folder of another call, a place that cannot be written; and those of `fill`.
    pub(crate) fn open<E: From<WorkError>>(
        path: &Path,
        manifest: &Manifest,
        parts: &[&str],
        fill: impl FnOnce(&NewWork<'_>) -> Result<(), E>,
    ) -> Result<Self, E> {
        if path.symlink_metadata().is_err() {
            if !folder(path).is_dir() {
                return Err(WorkError::Place { path: path.into() }.into());
            }
            let failed = |error| WorkError::io(path, error);
            let new = NewWork {
                filling: NewFolder::new(path).map_err(failed)?,
                place: path,
            };
            for part in parts {
                std::fs::create_dir(new.filling.file(part)).map_err(failed)?;
            }
            fill(&new)?;
            new.write(MANIFEST, manifest.text().as_bytes())?;
            match new.filling.finish() {
                Err(error) if !taken(&error) => return Err(failed(error).into()),
                _ => {}
            }
        }
        Ok(Self::resume(path, manifest)?)
    }

    /// The folder that the same call made.
    ///
    /// # Errors
    ///
    /// [`WorkError`]: no folder of this verb, a folder of another call.
    pub(crate) fn resume(path: &Path, manifest: &Manifest) -> Result<Self, WorkError> {
        let (found, there) = Self::find(path, manifest.verb())?;
        match manifest.differs(&there) {
            None => Ok(found),
            Some(difference) => Err(WorkError::Other {
                path: path.into(),
                difference,
            }),
        }
    }

    /// The folder at a path, whatever call of `verb` made it.
    ///
    /// # Errors
    ///
    /// [`WorkError::Foreign`] for anything else.
    pub(crate) fn find(path: &Path, verb: &'static str) -> Result<(Self, Manifest), WorkError> {
        let text = read_kept_text(&path.join(MANIFEST), MOST).ok();
        let found = text.and_then(|text| Manifest::parse(verb, &text));
        let path = path.to_owned();
        match found {
            Some(manifest) => Ok((Self { path }, manifest)),
            None => Err(WorkError::Foreign { path, verb }),
        }
    }

    /// Where it lies.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Where a file of the folder lies.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Writes a result, in place of an earlier one.
    ///
    /// # Errors
    ///
    /// [`WorkError::Io`].
    pub(crate) fn write(&self, name: &str, text: &str) -> Result<(), WorkError> {
        let path = self.file(name);
        replace(&path, text.as_bytes()).map_err(|error| WorkError::io(&path, error))
    }

    /// Removes the folder with all that is in it: the work is done, and its result is elsewhere.
    ///
    /// It goes from its place at once, so that nobody ever meets a half of it.
    ///
    /// # Errors
    ///
    /// [`WorkError::Io`].
    pub(crate) fn remove(self) -> Result<(), WorkError> {
        let gone = removed(&self.path);
        std::fs::rename(&self.path, &gone).map_err(|error| WorkError::io(&self.path, error))?;
        Self::sweep_removed(&self.path)
    }

    /// Ends the removal of a folder that was at `path`, where a process died in the middle of it.
    ///
    /// # Errors
    ///
    /// [`WorkError::Io`].
    pub(crate) fn sweep_removed(path: &Path) -> Result<(), WorkError> {
        let gone = removed(path);
        match std::fs::remove_dir_all(&gone) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                Err(WorkError::io(&gone, error))
            }
            _ => Ok(()),
        }
    }

    /// Puts the checksums of all pieces into the manifest: the work is finished.
    ///
    /// # Errors
    ///
    /// [`WorkError::Io`].
    pub(crate) fn finish(&self, manifest: &Manifest, checksums: Value) -> Result<(), WorkError> {
        self.write(MANIFEST, &manifest.clone().finished(checksums).text())
    }

    /// A file of the folder as text.
    ///
    /// # Errors
    ///
    /// [`WorkError::Io`].
    pub(crate) fn read(&self, name: &str) -> Result<String, WorkError> {
        let path = self.file(name);
        read_kept_text(&path, MOST).map_err(|error| WorkError::io(&path, error))
    }

    /// Where a part lies; a link that leads out of the folder is none.
    ///
    /// # Errors
    ///
    /// [`WorkError::Io`].
    pub(crate) fn part(&self, part: &str) -> Result<PathBuf, WorkError> {
        let path = self.file(part);
        check_folder(&path).map_err(|error| WorkError::io(&path, error))?;
        Ok(path)
    }

    fn piece(&self, part: &str, number: usize) -> Result<PathBuf, WorkError> {
        Ok(self.part(part)?.join(format!("{number:04}.json")))
    }

    /// Piece `number` of a part, if it was kept; `fits` says what is wrong with it.
    ///
    /// # Errors
    ///
    /// [`WorkError::Io`]; [`WorkError::Piece`] for a file that is no such piece.
    pub(crate) fn kept<T: DeserializeOwned>(
        &self,
        part: &str,
        number: usize,
        fits: impl FnOnce(&T) -> Result<(), &'static str>,
    ) -> Result<Option<T>, WorkError> {
        let path = self.piece(part, number)?;
        let text = match read_kept_text(&path, MOST) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(WorkError::io(&path, error)),
        };
        let wrong = |reason: String| WorkError::Piece {
            path: path.clone(),
            reason: one_line(&reason, MESSAGE),
        };
        let found: T = serde_json::from_str(&text).map_err(|error| wrong(error.to_string()))?;
        fits(&found).map_err(|reason| wrong(reason.into()))?;
        Ok(Some(found))
    }

    /// Keeps piece `number` of a part; where another process has kept it in the meantime, that one stays.
    ///
    /// # Errors
    ///
    /// [`WorkError::Io`].
    pub(crate) fn keep<T: Serialize>(
        &self,
        part: &str,
        number: usize,
        piece: &T,
    ) -> Result<(), WorkError> {
        let path = self.piece(part, number)?;
        let written = serde_json::to_string_pretty(piece)
            .map_err(io::Error::from)
            .and_then(|text| write_new(&path, format!("{text}\n").as_bytes()));
        match written {
            Err(error) if !path.exists() => Err(WorkError::io(&path, error)),
            _ => Ok(()),
        }
    }

    /// Sweeps out what processes that died have left in a part whose pieces are all there.
    pub(super) fn sweep(&self, part: &str) -> Result<(), WorkError> {
        let place = self.part(part)?;
        sweep(&place).map_err(|error| WorkError::io(&place, error))
    }
}

/// What the folder at a path is called while it is removed.
fn removed(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{PREFIX}{name}"))
}

/// Whether another process was faster to put a folder in its place.
fn taken(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::AlreadyExists | io::ErrorKind::DirectoryNotEmpty
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn manifest(runs: u32) -> Manifest {
        Manifest::new("reproduce", 1).with("runs", runs)
    }

    fn open(path: &Path, runs: u32) -> Result<WorkFolder, WorkError> {
        WorkFolder::open(path, &manifest(runs), &["runs"], |new| {
            new.write("start.txt", b"a")
        })
    }

    #[test]
    fn pieces_are_kept_whole_and_found_again() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("work");
        let folder = open(&path, 2).unwrap();
        let any = |_: &Vec<u32>| Ok(());
        assert_eq!(folder.kept("runs", 1, any).unwrap(), None);
        folder.keep("runs", 1, &vec![1, 2]).unwrap();
        folder.keep("runs", 1, &vec![3]).unwrap();
        let again = open(&path, 2).unwrap();
        assert_eq!(again.kept("runs", 1, any).unwrap(), Some(vec![1, 2]));
        let refused = |_: &Vec<u32>| Err("it is odd");
        let error = again.kept("runs", 1, refused).unwrap_err().to_string();
        assert!(
            error.contains("0001.json") && error.contains("it is odd"),
            "{error}"
        );
        fs::write(path.join("runs/0001.json"), "[1, ").unwrap();
        let error = again.kept("runs", 1, any).unwrap_err().to_string();
        assert!(error.contains("remove it"), "{error}");
    }

    #[test]
    fn a_folder_is_removed_whole_and_a_removal_is_ended() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("work");
        let left = removed(&path);
        fs::create_dir(&left).unwrap();
        fs::write(left.join("half.txt"), "").unwrap();
        WorkFolder::sweep_removed(&path).unwrap();
        open(&path, 2).unwrap().remove().unwrap();
        WorkFolder::sweep_removed(&path).unwrap();
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 0);
    }

    #[test]
    fn other_folders_are_refused_and_nothing_is_left_over() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("work");
        open(&path, 2).unwrap();
        let refused = |path: &Path, runs| open(path, runs).unwrap_err().to_string();
        assert!(refused(&path, 3).contains("runs was 2, now it is 3"));
        assert!(refused(place.path(), 2).contains("no folder of `reproduce`"));
        assert!(refused(&place.path().join("a/b"), 2).contains("make it first"));
        let failed: Result<_, WorkError> =
            WorkFolder::open(&place.path().join("new"), &manifest(1), &[], |_| {
                Err(WorkError::io(Path::new("x"), io::Error::other("full")))
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
}
