//! The folder of shards.

use crate::estimator::bank::{Bank, Draws, file};
use crate::estimator::error::EstimatorError;
use crate::estimator::settings::MOST_SIMULATIONS;
use crate::storage::StorageError;
use crate::storage::checksum::sha256;
use crate::storage::files::write_new;
use crate::storage::untrusted::{MOST_NUMBERS, read_kept};
use crate::storage::work::{Manifest, WorkFolder};
use serde_json::{Value, json};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Verb whose folders hold banks.
pub(super) const VERB: &str = "bank";
/// About so many shards make a bank, unless they would be smaller or larger than this.
const SHARES: usize = 64;
const FEWEST_ROWS: usize = 16;
const MOST_ROWS: usize = 16_384;
/// Folder of the shards.
pub(super) const SHARDS: &str = "shards";
/// Remedy for a damaged shard.
const AGAIN: &str = "make the same bank again, and it is replaced";

/// Content of a folder of shards.
#[derive(Debug, Clone)]
pub(super) struct Shards {
    folder: WorkFolder,
    pub manifest: Manifest,
    /// Simulations of the whole bank.
    pub size: usize,
    rows: usize,
    /// Names of the parameters.
    pub names: Vec<String>,
    /// Shards of the whole bank.
    pub of: usize,
    /// Checksum of each shard that is there.
    pub there: BTreeMap<usize, String>,
}

/// Returns the rows of each shard but the last: a function of the bank's size alone.
pub(super) fn rows_of_a_shard(size: usize) -> usize {
    size.div_ceil(SHARES).clamp(FEWEST_ROWS, MOST_ROWS)
}

/// The name of a shard.
fn name(number: usize, checksum: &str) -> String {
    format!("{number:06}-{checksum}.npz")
}

/// Number and checksum of a shard, of its name; `None` for any other file.
fn parse(name: &str) -> Option<(usize, &str)> {
    let (number, checksum) = name.strip_suffix(".npz")?.split_once('-')?;
    let hexadecimal = checksum.bytes().all(|b| b.is_ascii_hexdigit());
    (checksum.len() == 64 && hexadecimal).then_some((number.parse().ok()?, checksum))
}

impl Shards {
    /// Lists a folder with this manifest.
    pub fn list(folder: WorkFolder, manifest: Manifest) -> Result<Self, EstimatorError> {
        let number = |key: &str| {
            (manifest.get(key).and_then(Value::as_u64))
                .filter(|n| *n > 0)
                .and_then(|n| usize::try_from(n).ok())
        };
        let names = (manifest.get("parameters").and_then(Value::as_array)).and_then(|all| {
            let name = |p: &Value| p["name"].as_str().map(str::to_owned);
            all.iter().map(name).collect::<Option<Vec<String>>>()
        });
        // Everything below counts shards: no manifest may make it count without end.
        let size = number("size").filter(|size| *size <= MOST_SIMULATIONS);
        let rows = size.map(rows_of_a_shard);
        let rows = rows.filter(|rows| number("rows of a shard") == Some(*rows));
        let (Some(size), Some(rows), Some(names)) = (size, rows, names) else {
            return Err(foreign(folder.path()).into());
        };
        let of = size.div_ceil(rows);
        let place = folder.part(SHARDS)?;
        let mut there = BTreeMap::new();
        let failed = |error| EstimatorError::from(StorageError::io(&place, error));
        for entry in std::fs::read_dir(&place).map_err(failed)? {
            let found = entry.map_err(failed)?.file_name();
            let Some((number, checksum)) = found.to_str().and_then(parse) else {
                continue;
            };
            if number >= of {
                continue;
            }
            if let Some(other) = there.insert(number, checksum.to_owned()) {
                let at = |c| place.join(name(number, c));
                let (_, kept) = WorkFolder::find(folder.path(), VERB)?;
                let own = kept.checksums().and_then(|sums| sums[number].as_str());
                let stray = own.map(|own| if own == checksum { &other } else { checksum });
                return Err(match stray {
                    Some(stray) => EstimatorError::Bank(format!(
                        "{}: no shard of this bank; remove it",
                        at(stray).display()
                    )),
                    None => conflict(&at(checksum), &at(&other)),
                });
            }
        }
        Ok(Self {
            folder,
            manifest,
            size,
            rows,
            names,
            of,
            there,
        })
    }

    /// The same folder as it is now.
    pub fn again(self) -> Result<Self, EstimatorError> {
        Self::list(self.folder, self.manifest)
    }

    /// Rows of a shard.
    pub fn rows(&self, number: usize) -> Range<u64> {
        let end = ((number + 1) * self.rows).min(self.size);
        (number * self.rows) as u64..end as u64
    }

    /// Where a shard lies.
    pub fn file(&self, number: usize) -> Option<PathBuf> {
        let checksum = self.there.get(&number)?;
        Some(self.folder.file(SHARDS).join(name(number, checksum)))
    }

    /// Returns the path that a message about a shard names.
    fn place(&self, number: usize) -> PathBuf {
        (self.file(number)).unwrap_or_else(|| self.folder.path().into())
    }

    /// The bytes of a shard, if they are what they were.
    pub fn bytes(&self, number: usize) -> Result<Vec<u8>, EstimatorError> {
        let path = self.file(number).ok_or_else(|| self.incomplete())?;
        let bytes = read_kept(&path, 8 * MOST_NUMBERS as u64)
            .map_err(|error| EstimatorError::io(&path, error))?;
        if self.there.get(&number) == Some(&sha256(&bytes)) {
            Ok(bytes)
        } else {
            Err(damaged(&path, "its SHA-256 is not that of its name"))
        }
    }

    /// The rows of a shard, checked.
    pub fn draws(&self, number: usize) -> Result<Draws, EstimatorError> {
        let bytes = self.bytes(number)?;
        let draws = file::from_npz(io::Cursor::new(bytes));
        let checked = draws.and_then(|draws| {
            file::check(&draws, self.names.len())?;
            if draws.theta.nrows() == self.rows(number).count() {
                Ok(draws)
            } else {
                Err("another number of rows".into())
            }
        });
        checked.map_err(|reason| damaged(&self.place(number), &reason))
    }

    /// The folder's name, for messages.
    pub fn name(&self) -> String {
        self.folder.path().display().to_string()
    }

    fn incomplete(&self) -> EstimatorError {
        let (there, of) = (self.there.len(), self.of);
        let missing = (0..of).find(|number| !self.there.contains_key(number));
        let problem = format!(
            "{there} of {of} shards are there, {} is missing; make the same bank again to add the others",
            missing.unwrap_or_default()
        );
        EstimatorError::NoBank {
            path: self.folder.path().into(),
            problem,
        }
    }

    /// Returns the error of a shard whose rows are wider or narrower than those of the first.
    pub fn odd(&self, number: usize) -> EstimatorError {
        damaged(&self.place(number), "another number of features")
    }

    /// Returns whether a shard is there and is what it was; removes one that is not.
    pub fn keeps(&self, number: usize) -> Result<bool, EstimatorError> {
        match (self.bytes(number), self.file(number)) {
            (Ok(_), _) => Ok(true),
            (Err(EstimatorError::NoBank { .. }), Some(path)) => std::fs::remove_file(&path)
                .map(|()| false)
                .map_err(|error| EstimatorError::io(&path, error)),
            (Err(EstimatorError::NoBank { .. }), None) => Ok(false),
            // A file that cannot be read now may be sound.
            (Err(error), _) => Err(error),
        }
    }

    /// Adds a shard; where another process has made it in the meantime, that one stays.
    pub fn add(&self, number: usize, bytes: &[u8]) -> Result<(), EstimatorError> {
        let path = (self.folder.part(SHARDS)?).join(name(number, &sha256(bytes)));
        match write_new(&path, bytes) {
            Err(error) if !path.exists() => Err(EstimatorError::io(&path, error)),
            _ => Ok(()),
        }
    }

    /// Puts the checksums into the manifest, if every shard is there; sweeps out what processes that died have left.
    pub fn finish(&self) -> Result<(), EstimatorError> {
        if self.there.len() == self.of {
            let checksums: Vec<&String> = self.there.values().collect();
            self.folder.finish(&self.manifest, json!(checksums))?;
            self.folder.sweep();
        }
        Ok(())
    }

    /// Refuses a whole bank whose shards are not those of its finished manifest.
    pub(super) fn check_finished(&self, finished: Option<&Value>) -> Result<(), EstimatorError> {
        let there = json!(self.there.values().collect::<Vec<_>>());
        match finished {
            Some(sums) if self.there.len() == self.of && *sums != there => Err(damaged(
                &self.folder.file(SHARDS),
                "its shards are not those of manifest.json",
            )),
            _ => Ok(()),
        }
    }
}

/// Returns the error of a folder whose manifest is incomplete.
fn foreign(path: &Path) -> StorageError {
    StorageError::Foreign {
        path: path.into(),
        verb: VERB,
        reason: "its manifest.json is damaged".into(),
    }
}

fn damaged(path: &Path, reason: &str) -> EstimatorError {
    EstimatorError::no_bank(path, reason, AGAIN)
}

/// Two folders hold different rows under the same numbers.
pub(super) fn conflict(one: &Path, other: &Path) -> EstimatorError {
    EstimatorError::Bank(format!(
        "{} and {} differ, and should hold the same rows; make both with the same build on machines of one kind, or remove the one that is of another bank",
        one.display(),
        other.display()
    ))
}

/// A whole bank on disk: each shard is a part, read when it is asked for.
#[derive(Debug, Clone)]
pub struct ShardedBank {
    shards: Shards,
    seed: u64,
}

impl ShardedBank {
    /// The bank in a folder.
    pub fn open(path: &Path) -> Result<Self, EstimatorError> {
        let (folder, manifest) = WorkFolder::find(path, VERB)?;
        let seed = manifest.get("seed").and_then(Value::as_u64);
        let seed = seed.ok_or_else(|| foreign(path))?;
        let finished = manifest.checksums().cloned();
        let shards = Shards::list(folder, manifest)?;
        if shards.there.len() < shards.of || finished.is_none() {
            return Err(shards.incomplete());
        }
        shards.check_finished(finished.as_ref())?;
        Ok(Self { shards, seed })
    }

    /// Returns whether there is any shard in a folder.
    pub(crate) fn is_begun(path: &Path) -> bool {
        let shards = std::fs::read_dir(path.join(SHARDS));
        shards.is_ok_and(|mut shards| shards.next().is_some())
    }

    /// Simulations, M.
    pub fn size(&self) -> usize {
        self.shards.size
    }

    /// The seed of its rows.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// All rows, in memory.
    pub fn read(&self) -> Result<Draws, EstimatorError> {
        let parts = (0..self.shards.of).map(|index| self.part(index));
        Draws::stacked(self.size(), parts, |index| self.shards.odd(index))
    }

    /// Returns the checksum of the bank.
    pub fn checksum(&self) -> String {
        self.shards.manifest.checksum()
    }

    /// Where it lies.
    pub fn path(&self) -> &Path {
        self.shards.folder.path()
    }

    pub(super) fn manifest(&self) -> &Manifest {
        &self.shards.manifest
    }
}

impl Bank for ShardedBank {
    fn parts(&self) -> Vec<usize> {
        let rows = |number| self.shards.rows(number).count();
        (0..self.shards.of).map(rows).collect()
    }

    fn part(&self, index: usize) -> Result<Cow<'_, Draws>, EstimatorError> {
        self.shards.draws(index).map(Cow::Owned)
    }
}
