//! A folder that keeps runs, so that a long study can be interrupted and gone on with.

use super::{Manifest, Run};
use crate::files::{NewFolder, folder, replace, with_remedy, write_new};
use std::io;
use std::path::{Path, PathBuf};

const MANIFEST: &str = "manifest.json";
const RUNS: &str = "runs";

/// A folder with the runs of one study.
///
/// | file | holds |
/// |---|---|
/// | `manifest.json` | what the runs depend on; another call that differs is refused |
/// | `estimator.est` | the estimator, where it was trained for the study |
/// | `runs/0000.json`, … | a [`Run`] each; appears whole when it is done |
/// | anything else | results, made of the runs |
#[derive(Debug, Clone)]
pub struct Store(PathBuf);

/// Why a folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
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
        "{} exists already and is no folder of `reproduce`; choose another --out, or remove it",
        path.display()
    )]
    Foreign {
        /// Folder.
        path: PathBuf,
    },
    /// The folder is of another study.
    #[error(
        "{} holds runs of another call: {difference}; repeat that call to go on with it, or choose another --out",
        path.display()
    )]
    Other {
        /// Folder.
        path: PathBuf,
        /// What is different.
        difference: String,
    },
    /// A run that is not one of this study.
    #[error("{}: not a run of this study ({reason}); remove it, and it is run again", path.display())]
    Run {
        /// File.
        path: PathBuf,
        /// What does not fit.
        reason: String,
    },
}

impl StoreError {
    pub(super) fn io(path: &Path, error: io::Error) -> Self {
        Self::Io {
            path: path.into(),
            error,
        }
    }
}

impl Store {
    /// Makes the folder, or goes on with the one that is there.
    ///
    /// # Errors
    ///
    /// [`StoreError`]: a path that is taken, a folder made with another manifest.
    pub fn open(path: &Path, manifest: &Manifest) -> Result<Self, StoreError> {
        let store = Self(path.into());
        if path.symlink_metadata().is_err() {
            store.make(manifest)?;
            return Ok(store);
        }
        let foreign = || StoreError::Foreign { path: path.into() };
        let found = match std::fs::read_to_string(store.file(MANIFEST)) {
            Ok(text) => Manifest::parse(&text).ok_or_else(foreign)?,
            Err(_) => return Err(foreign()),
        };
        match manifest.differs(&found) {
            None => Ok(store),
            Some(difference) => Err(StoreError::Other {
                path: path.into(),
                difference,
            }),
        }
    }

    /// The folder appears with its manifest in it.
    fn make(&self, manifest: &Manifest) -> Result<(), StoreError> {
        let path = &self.0;
        if !folder(path).is_dir() {
            return Err(StoreError::Place { path: path.clone() });
        }
        let made = NewFolder::new(path).and_then(|new| {
            std::fs::create_dir(new.file(RUNS))?;
            write_new(&new.file(MANIFEST), manifest.text().as_bytes())?;
            new.finish()
        });
        made.map_err(|error| StoreError::io(path, error))
    }

    /// Where a file of the folder lies.
    pub fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Where the estimator lies that is trained for the study.
    pub fn estimator(&self) -> PathBuf {
        self.file("estimator.est")
    }

    /// Writes a result, in place of an earlier one.
    pub fn write(&self, name: &str, text: &str) -> Result<(), StoreError> {
        let path = self.file(name);
        replace(&path, text.as_bytes()).map_err(|error| StoreError::io(&path, error))
    }

    fn run_file(&self, run: usize) -> PathBuf {
        self.file(RUNS).join(format!("{run:04}.json"))
    }

    /// A run of a study with so many parameters, if it was kept.
    pub(super) fn load(&self, run: usize, parameters: usize) -> Result<Option<Run>, StoreError> {
        let path = self.run_file(run);
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(StoreError::io(&path, error)),
        };
        let wrong = |reason: String| StoreError::Run {
            path: path.clone(),
            reason,
        };
        let found: Run = serde_json::from_str(&text).map_err(|error| wrong(error.to_string()))?;
        match found.fits(run, parameters) {
            true => Ok(Some(found)),
            false => Err(wrong("its number, methods or parameters differ".into())),
        }
    }

    /// Keeps a run.
    pub(super) fn keep(&self, run: &Run) -> Result<(), StoreError> {
        let path = self.run_file(run.run);
        let text = serde_json::to_string_pretty(run)
            .map_err(|error| StoreError::io(&path, error.into()))?;
        write_new(&path, format!("{text}\n").as_bytes())
            .map_err(|error| StoreError::io(&path, error))
    }
}
