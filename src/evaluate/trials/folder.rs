//! The folder of the trials: sealed keys, records, answers.

use super::truth::Truth;
use crate::evaluate::EvaluateError;
use crate::record::{Record, record_csv_text};
use crate::storage::checksum::{sha256, sha256_of};
use crate::storage::reading::checksum_of_read;
use crate::storage::untrusted::check_file;
use crate::storage::work::{Manifest, WorkFolder};
use crate::storage::{NewFolder, StorageError};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use std::cell::RefCell;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const KEYS: &str = "keys.json";
const SEAL: &str = "seal.txt";
const LEFT_OUT: &str = "left-out.json";
const RECORDS: &str = "records";
/// Answers of the diagnoser.
pub(super) const ANSWERS: &str = "answers";
/// Shares that true effects close.
pub(super) const SHARES: &str = "shares";

/// A folder of trials: what every [`WorkFolder`] has, and
///
/// | file | holds |
/// |---|---|
/// | `keys.json` | the truth of every trial; not read again before every answer is there |
/// | `seal.txt` | SHA-256 of `keys.json`, published before the first diagnosis |
/// | `left-out.json` | the effects that each trial's library does without, where the call asks for that |
/// | `manifest.json` | what every such folder has, and the checksums of the records |
/// | `records/0000.csv`, `records/0000-validation.csv`, `records/0000-doubled.csv` | what the diagnoser sees |
/// | `answers/0000.json` | what it said |
/// | `shares/0000.json` | the share that the true effects close, measured once the keys are open |
/// | `scorecard.json`, `scorecard.html` | made of all that |
#[derive(Debug, Clone)]
pub(super) struct Folder {
    pub work: WorkFolder,
    /// Checksums of the records, by name.
    records: Arc<Map<String, Value>>,
    /// SHA-256 of the key file.
    pub seal: String,
}

/// Record of a trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Which {
    Own,
    Validation,
    /// The same system, twice as long.
    Doubled,
}

fn record_name(trial: usize, which: Which) -> String {
    let end = match which {
        Which::Own => "",
        Which::Validation => "-validation",
        Which::Doubled => "-doubled",
    };
    format!("{RECORDS}/{trial:04}{end}.csv")
}

/// A new folder that is filled with sealed trials.
pub(super) struct Filling<'a> {
    folder: &'a NewFolder,
    /// Checksums of the records, by name.
    records: RefCell<Map<String, Value>>,
}

impl Filling<'_> {
    /// Adds a record.
    pub fn record(&self, trial: usize, which: Which, record: &Record) -> Result<(), StorageError> {
        let name = record_name(trial, which);
        let text = record_csv_text(record);
        self.folder.write(&name, text.as_bytes())?;
        (self.records.borrow_mut()).insert(name, sha256(text.as_bytes()).into());
        Ok(())
    }

    /// Says which effects each trial's library does without: the diagnoser may know that much.
    pub fn left_out(&self, effects: &[&Vec<String>]) -> Result<(), StorageError> {
        self.json(LEFT_OUT, effects).map(|_| ())
    }

    /// Writes keys and seal.
    pub fn keys(&self, keys: &[Truth]) -> Result<(), StorageError> {
        let keys = self.json(KEYS, keys)?;
        let seal = sha256(keys.as_bytes());
        self.folder.write(SEAL, format!("{seal}\n").as_bytes())
    }

    fn json<T: Serialize + ?Sized>(&self, name: &str, value: &T) -> Result<String, StorageError> {
        let text = serde_json::to_string_pretty(value)
            .map_err(|error| StorageError::io(Path::new(name), io::Error::from(error)))?;
        let text = format!("{text}\n");
        self.folder.write(name, text.as_bytes())?;
        Ok(text)
    }
}

impl Folder {
    /// Goes on with a folder that was made by the same call; or makes one, which `fill` fills.
    pub fn open(
        path: &Path,
        manifest: &Manifest,
        fill: impl FnOnce(&Filling<'_>) -> Result<(), EvaluateError>,
    ) -> Result<Self, EvaluateError> {
        let parts = [RECORDS, ANSWERS, SHARES];
        let work = WorkFolder::open(path, manifest, &parts, |folder| {
            let records = RefCell::default();
            let filling = Filling { folder, records };
            fill(&filling)?;
            Ok::<_, EvaluateError>(Some(filling.records.into_inner().into()))
        })?;
        let seal = work.read(SEAL)?.trim().into();
        let (_, kept) = WorkFolder::find(path, manifest.verb())?;
        let records = kept.checksums().and_then(Value::as_object).cloned();
        let records = Arc::new(records.unwrap_or_default());
        Ok(Self {
            work,
            records,
            seal,
        })
    }

    /// Reads a trial's record.
    pub fn record(&self, trial: usize, which: Which) -> Result<Record, EvaluateError> {
        let name = record_name(trial, which);
        let path = self.record_file(&name)?;
        let record = Record::read(&path)?;
        self.check_sum(&name, checksum_of_read(&path).as_deref())?;
        Ok(record)
    }

    /// Refuses a trial's record that is not the one that was sealed, without reading it into memory.
    pub fn check_record(&self, trial: usize, which: Which) -> Result<(), EvaluateError> {
        let name = record_name(trial, which);
        let path = self.record_file(&name)?;
        let sum = sha256_of(&path).map_err(|error| StorageError::io(&path, error))?;
        self.check_sum(&name, Some(&sum))
    }

    fn record_file(&self, name: &str) -> Result<PathBuf, EvaluateError> {
        self.work.part(RECORDS)?;
        let path = self.work.file(name);
        match check_file(&path) {
            Ok(()) => Ok(path),
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                Err(self.damaged(name, "it is missing"))
            }
            Err(error) => Err(StorageError::io(&path, error).into()),
        }
    }

    fn check_sum(&self, name: &str, sum: Option<&str>) -> Result<(), EvaluateError> {
        match self.records.get(name).and_then(Value::as_str) {
            sealed @ Some(_) if sealed == sum => Ok(()),
            _ => Err(self.damaged(name, "its SHA-256 is not that of manifest.json")),
        }
    }

    /// Opens the keys of so many trials, if they are still those that were sealed.
    pub fn keys(&self, trials: usize) -> Result<Vec<Truth>, EvaluateError> {
        let text = self.work.read(KEYS)?;
        if sha256(text.as_bytes()) != self.seal {
            return Err(self.damaged(KEYS, "its SHA-256 is not that of seal.txt"));
        }
        self.list(KEYS, &text, |keys: &Vec<Truth>| {
            keys.iter().map(|key| key.trial).eq(0..trials)
        })
    }

    /// The effects that the libraries of so many trials do without.
    pub fn left_out(&self, trials: usize) -> Result<Vec<Vec<String>>, EvaluateError> {
        let text = self.work.read(LEFT_OUT)?;
        self.list(LEFT_OUT, &text, |all: &Vec<Vec<String>>| {
            all.len() == trials
        })
    }

    /// Refuses a list of effects that libraries do without which is not that of the keys.
    pub fn check_left_out(&self, keys: &[Truth]) -> Result<(), EvaluateError> {
        let left_out = self.left_out(keys.len())?;
        match left_out.iter().eq(keys.iter().map(|key| &key.effects)) {
            true => Ok(()),
            false => Err(self.damaged(LEFT_OUT, "its effects are not those of keys.json")),
        }
    }

    fn list<T: DeserializeOwned>(
        &self,
        file: &str,
        text: &str,
        is_whole: impl Fn(&T) -> bool,
    ) -> Result<T, EvaluateError> {
        let list =
            serde_json::from_str(text).map_err(|error| self.damaged(file, &error.to_string()))?;
        match is_whole(&list) {
            true => Ok(list),
            false => Err(self.damaged(file, "trials are missing")),
        }
    }

    fn damaged(&self, file: &str, reason: &str) -> EvaluateError {
        EvaluateError::Damaged {
            path: self.work.file(file),
            reason: reason.to_owned(),
            remedy: "remove the folder and start again",
        }
    }
}
