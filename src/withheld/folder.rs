//! The folder of the trials: sealed keys, records, answers.

use super::WithheldError;
use super::truth::Truth;
use crate::experiment::manifest::difference;
use crate::files::{NewFolder, folder, replace, sha256, write_new};
use crate::twin::{Record, read_record, record_csv_text};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use std::io;
use std::path::{Path, PathBuf};

const MANIFEST: &str = "manifest.json";
const KEYS: &str = "keys.json";
const SEAL: &str = "seal.txt";
const LEFT_OUT: &str = "left-out.json";
const RECORDS: &str = "records";
/// What the diagnoser said.
pub(super) const ANSWERS: &str = "answers";
/// What the opened keys added.
pub(super) const OPENED: &str = "opened";
/// Of a key file that is not the one that was sealed.
const AGAIN: &str = "remove the folder and start again";

/// A folder of trials.
///
/// | file | holds |
/// |---|---|
/// | `manifest.json` | what the trials depend on; another call that differs is refused |
/// | `keys.json` | the truth of every trial; not read again before every answer is there |
/// | `seal.txt` | SHA-256 of `keys.json`, published before the first diagnosis |
/// | `left-out.json` | the effects that each trial's library does without, where the call asks for that |
/// | `records/0000.csv`, `records/0000-validation.csv` | what the diagnoser sees |
/// | `answers/0000.json` | what it said; appears whole when it is done |
/// | `opened/0000.json` | what the true effect gains; made with the key |
/// | `scorecard.json`, `scorecard.html` | made of all that |
#[derive(Debug, Clone)]
pub(super) struct Folder {
    path: PathBuf,
    /// SHA-256 of the key file.
    pub seal: String,
}

/// One trial's records, by number.
fn record_name(trial: usize, validation: bool) -> String {
    match validation {
        true => format!("{trial:04}-validation.csv"),
        false => format!("{trial:04}.csv"),
    }
}

/// A new folder that is filled with sealed trials.
pub(super) struct Filling {
    new: NewFolder,
    place: PathBuf,
}

impl Filling {
    /// A folder that will be at `place`.
    pub fn new(place: &Path) -> Result<Self, WithheldError> {
        if !folder(place).is_dir() {
            return Err(WithheldError::Place { path: place.into() });
        }
        let made = NewFolder::new(place).and_then(|new| {
            for name in [RECORDS, ANSWERS, OPENED] {
                std::fs::create_dir(new.file(name))?;
            }
            Ok(new)
        });
        Ok(Self {
            new: made.map_err(|error| WithheldError::io(place, error))?,
            place: place.into(),
        })
    }

    /// Adds a record.
    pub fn record(
        &self,
        trial: usize,
        validation: bool,
        record: &Record,
    ) -> Result<(), WithheldError> {
        let name = Path::new(RECORDS).join(record_name(trial, validation));
        self.write(&name, record_csv_text(record).as_bytes())
    }

    /// Says which effects each trial's library does without: the diagnoser may know that much.
    pub fn left_out(&self, effects: &[&Vec<String>]) -> Result<(), WithheldError> {
        let text = json_text(effects).map_err(|error| WithheldError::io(&self.place, error))?;
        self.write(Path::new(LEFT_OUT), text.as_bytes())
    }

    /// Writes keys, seal and manifest, and puts the folder in its place.
    pub fn finish(
        self,
        keys: &[Truth],
        manifest: &Map<String, Value>,
    ) -> Result<Folder, WithheldError> {
        let keys = json_text(keys).map_err(|error| WithheldError::io(&self.place, error))?;
        let seal = sha256(keys.as_bytes());
        self.write(Path::new(KEYS), keys.as_bytes())?;
        self.write(Path::new(SEAL), format!("{seal}\n").as_bytes())?;
        let text = json_text(manifest).map_err(|error| WithheldError::io(&self.place, error))?;
        self.write(Path::new(MANIFEST), text.as_bytes())?;
        let finished = self.new.finish();
        finished.map_err(|error| WithheldError::io(&self.place, error))?;
        Ok(Folder {
            path: self.place,
            seal,
        })
    }

    fn write(&self, name: &Path, bytes: &[u8]) -> Result<(), WithheldError> {
        let path = self.new.file("").join(name);
        std::fs::write(path, bytes)
            .map_err(|error| WithheldError::io(&self.place.join(name), error))
    }
}

impl Folder {
    /// Goes on with a folder that was made by the same call; `None` where there is nothing yet.
    pub fn open(path: &Path, manifest: &Map<String, Value>) -> Result<Option<Self>, WithheldError> {
        if path.symlink_metadata().is_err() {
            return Ok(None);
        }
        let foreign = || WithheldError::Foreign { path: path.into() };
        let text = std::fs::read_to_string(path.join(MANIFEST)).map_err(|_| foreign())?;
        let found: Map<String, Value> = serde_json::from_str(&text).map_err(|_| foreign())?;
        if !(found.get("schema").and_then(Value::as_str))
            .is_some_and(|schema| schema.starts_with("truetwin.withheld-folder/"))
        {
            return Err(foreign());
        }
        if let Some(difference) = difference(manifest, &found) {
            return Err(WithheldError::Other {
                path: path.into(),
                difference,
            });
        }
        let file = path.join(SEAL);
        let seal = std::fs::read_to_string(&file).map_err(|e| WithheldError::io(&file, e))?;
        Ok(Some(Self {
            path: path.into(),
            seal: seal.trim().into(),
        }))
    }

    /// Where a file lies.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Reads a trial's record.
    pub fn record(&self, trial: usize, validation: bool) -> Result<Record, WithheldError> {
        let path = self.file(RECORDS).join(record_name(trial, validation));
        Ok(read_record(&path)?)
    }

    /// Opens the keys of so many trials, if they are still those that were sealed.
    pub fn keys(&self, trials: usize) -> Result<Vec<Truth>, WithheldError> {
        let path = self.file(KEYS);
        let bytes = std::fs::read(&path).map_err(|error| WithheldError::io(&path, error))?;
        let damaged = |reason: String| WithheldError::Damaged {
            path: path.clone(),
            reason,
            remedy: AGAIN,
        };
        if sha256(&bytes) != self.seal {
            return Err(damaged("its SHA-256 is not that of seal.txt".into()));
        }
        let keys: Vec<Truth> =
            serde_json::from_slice(&bytes).map_err(|error| damaged(error.to_string()))?;
        match keys.iter().map(|key| key.trial).eq(0..trials) {
            true => Ok(keys),
            false => Err(damaged("trials are missing".into())),
        }
    }

    /// The effects that the libraries of so many trials do without.
    pub fn left_out(&self, trials: usize) -> Result<Vec<Vec<String>>, WithheldError> {
        let path = self.file(LEFT_OUT);
        let text =
            std::fs::read_to_string(&path).map_err(|error| WithheldError::io(&path, error))?;
        let damaged = |reason: String| WithheldError::Damaged {
            path: path.clone(),
            reason,
            remedy: AGAIN,
        };
        let found: Vec<Vec<String>> =
            serde_json::from_str(&text).map_err(|error| damaged(error.to_string()))?;
        match found.len() == trials {
            true => Ok(found),
            false => Err(damaged("trials are missing".into())),
        }
    }

    /// What is kept of a trial in `answers` or `opened`, if it is there.
    pub fn kept<T: DeserializeOwned>(
        &self,
        what: &str,
        trial: usize,
        number: impl Fn(&T) -> usize,
    ) -> Result<Option<T>, WithheldError> {
        let path = self.file(what).join(format!("{trial:04}.json"));
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(WithheldError::io(&path, error)),
        };
        let damaged = |reason: String| WithheldError::Damaged {
            path: path.clone(),
            reason,
            remedy: "remove it, and it is made again",
        };
        let found: T = serde_json::from_str(&text).map_err(|error| damaged(error.to_string()))?;
        match number(&found) == trial {
            true => Ok(Some(found)),
            false => Err(damaged("it is of another trial".into())),
        }
    }

    /// Keeps something of a trial.
    pub fn keep<T: Serialize>(
        &self,
        what: &str,
        trial: usize,
        value: &T,
    ) -> Result<(), WithheldError> {
        let path = self.file(what).join(format!("{trial:04}.json"));
        json_text(value)
            .and_then(|text| write_new(&path, text.as_bytes()))
            .map_err(|error| WithheldError::io(&path, error))
    }

    /// Writes a result, in place of an earlier one.
    pub fn write(&self, name: &str, text: &str) -> Result<(), WithheldError> {
        let path = self.file(name);
        replace(&path, text.as_bytes()).map_err(|error| WithheldError::io(&path, error))
    }
}

fn json_text<T: Serialize + ?Sized>(value: &T) -> io::Result<String> {
    Ok(format!("{}\n", serde_json::to_string_pretty(value)?))
}
