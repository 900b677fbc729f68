//! Manifest of a work folder: everything that a call must repeat to resume it.

use crate::storage::StorageError;
use crate::storage::checksum::{sha256, sha256_of};
use crate::storage::reading::checksum_of_read;
use crate::storage::untrusted::excerpt;
use serde_json::{Map, Value};
use std::path::Path;

/// Entry that a folder has in addition: of pieces, once it is finished, or of what it was filled with.
pub(super) const CHECKSUMS: &str = "checksums";
/// Entry of the file alone: the checksum of all others but that one.
const OWN: &str = "sha256";
/// Entry of verb and layout.
const LAYOUT: &str = "schema";
/// Entry of the program's version.
const VERSION: &str = "version";
/// Longest value that a message shows, in characters.
const SHORT: usize = 40;

/// Everything that the pieces in a folder depend on, in `manifest.json`.
#[derive(Debug, Clone, PartialEq)]
pub struct Manifest {
    verb: &'static str,
    entries: Map<String, Value>,
}

impl Manifest {
    /// Creates the manifest of a folder of `verb`; `layout` is raised when the folder's layout changes.
    pub fn new(verb: &'static str, layout: u32) -> Self {
        let entries = Map::new();
        Self { verb, entries }
            .with(LAYOUT, format!("truetwin.{verb}-folder/{layout}"))
            .with(VERSION, env!("CARGO_PKG_VERSION"))
    }

    /// Adds an entry.
    pub fn with(mut self, key: &str, value: impl Into<Value>) -> Self {
        self.entries.insert(key.into(), value.into());
        self
    }

    /// Returns an entry.
    pub fn get(&self, key: &str) -> Option<&Value> {
        self.entries.get(key)
    }

    /// Returns the checksums of the pieces of a finished folder.
    pub fn checksums(&self) -> Option<&Value> {
        self.entries.get(CHECKSUMS)
    }

    /// Removes the checksums.
    pub fn unfinished(mut self) -> Self {
        self.entries.shift_remove(CHECKSUMS);
        self
    }

    /// Verb that makes the folder.
    pub fn verb(&self) -> &'static str {
        self.verb
    }

    /// Returns the SHA-256 of the entries, in hexadecimal digits.
    pub(crate) fn checksum(&self) -> String {
        sha256(self.text().as_bytes())
    }

    fn text(&self) -> String {
        format!("{:#}\n", Value::Object(self.entries.clone()))
    }

    /// Returns the text of the file, with the checksum of the entries.
    pub(super) fn file_text(&self) -> String {
        let unfinished = self.clone().unfinished();
        let sum = unfinished.checksum();
        let mut whole = unfinished.with(OWN, sum);
        if let Some(checksums) = self.checksums() {
            whole = whole.with(CHECKSUMS, checksums.clone());
        }
        whole.text()
    }

    /// Parses the folder's text.
    pub(super) fn parse(verb: &'static str, text: &str) -> Result<Self, String> {
        let mut entries: Map<String, Value> = serde_json::from_str(text).map_err(|error| {
            format!(
                "its manifest.json is damaged: {}",
                excerpt(&error.to_string())
            )
        })?;
        let schema = entries.get(LAYOUT).and_then(Value::as_str);
        let maker = schema
            .and_then(|schema| schema.strip_prefix("truetwin.")?.split_once("-folder/"))
            .map(|(maker, _)| maker);
        match maker {
            Some(maker) if maker == verb => {
                let own = entries.shift_remove(OWN);
                let manifest = Self { verb, entries };
                // Folders of earlier versions have none.
                let is_own =
                    |sum: &Value| *sum == manifest.clone().unfinished().checksum().as_str();
                match own.as_ref().is_none_or(is_own) {
                    true => Ok(manifest),
                    false => Err("its manifest.json was altered".into()),
                }
            }
            Some(other) => Err(format!("it is a {} folder", excerpt(other))),
            None => Err("its manifest.json has another schema".into()),
        }
    }

    /// Tells whether the `kept` manifest is of the same version of the program, and of the same layout.
    pub fn is_of_version(&self, kept: &Self) -> bool {
        [LAYOUT, VERSION]
            .iter()
            .all(|key| kept.get(key) == self.get(key))
    }

    /// Returns the first difference from the `kept` manifest in words, finished or not; `None` if there is none.
    pub fn differs(&self, kept: &Self) -> Option<String> {
        self.difference(kept, |key, new, old| {
            format!("{key} was {old}, now it is {new}")
        })
    }

    /// Returns the first difference from another manifest as `tell` has it: of a key, the value here, and that of the other.
    pub fn difference(
        &self,
        other: &Self,
        tell: impl Fn(&str, &str, &str) -> String,
    ) -> Option<String> {
        let keys = self.entries.keys().chain(other.entries.keys());
        let differs = |key: &&String| *key != CHECKSUMS && other.get(key) != self.get(key);
        let key = { keys }.find(differs)?;
        let (own, others) = (shown(self.get(key)), shown(other.get(key)));
        let longest = own.chars().count().max(others.chars().count());
        Some(excerpt(&match longest <= SHORT {
            true => tell(key, &own, &others),
            false => format!("other {key}"),
        }))
    }
}

fn shown(value: Option<&Value>) -> String {
    match value {
        None | Some(Value::Null) => "not given".into(),
        Some(Value::String(text)) => text.clone(),
        Some(value) => value.to_string(),
    }
}

/// Returns the SHA-256 of a file that pieces depend on, in hexadecimal digits: as it was read, or as it is.
pub fn checksum(path: &Path) -> Result<String, StorageError> {
    checksum_of_read(path)
        .map_or_else(|| sha256_of(path), Ok)
        .map_err(|error| StorageError::io(path, error))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn manifest() -> Manifest {
        Manifest::new("reproduce", 1).with("runs", 2)
    }

    #[test]
    fn a_difference_is_named_with_both_values_where_they_are_short() {
        let there = manifest().with("network", "deep");
        assert_eq!(there.differs(&there), None);
        let differs = |here: Manifest| here.differs(&there).unwrap();
        assert_eq!(
            differs(there.clone().with("runs", 3)),
            "runs was 2, now it is 3"
        );
        assert_eq!(differs(manifest()), "network was deep, now it is not given");
        let long = there.clone().with("network", "x".repeat(50));
        assert_eq!(differs(long), "other network");
    }

    #[test]
    fn a_manifest_survives_its_file_and_other_files_are_refused() {
        let text = manifest().file_text();
        assert_eq!(Manifest::parse("reproduce", &text), Ok(manifest()));
        let finished = manifest().with(CHECKSUMS, vec!["a", "b"]);
        let parsed = Manifest::parse("reproduce", &finished.file_text());
        assert_eq!(parsed, Ok(finished));
        let altered = Manifest::parse("reproduce", &text.replace("\"runs\": 2", "\"runs\": 3"));
        assert_eq!(altered, Err("its manifest.json was altered".into()));
        let other = Manifest::parse("withheld", &text).unwrap_err();
        assert!(other.contains("a reproduce folder"), "{other}");
        for text in ["", "[]", "{}", r#"{"schema": "truetwin.gap/2"}"#] {
            assert!(Manifest::parse("reproduce", text).is_err(), "{text}");
        }
    }
}
