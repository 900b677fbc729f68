//! What a folder of work is about: what another call must say to go on with it.

use super::WorkError;
use crate::storage::files::{sha256, sha256_of};
use crate::storage::untrusted::excerpt;
use serde_json::{Map, Value};
use std::path::Path;

/// The entry that a finished folder has beside what its pieces depend on.
const CHECKSUMS: &str = "checksums";
/// Longest value that is worth showing in a message.
const SHORT: usize = 40;

/// Everything that the pieces in a folder depend on, in `manifest.json`.
#[derive(Debug, Clone, PartialEq)]
pub struct Manifest {
    verb: &'static str,
    entries: Map<String, Value>,
}

impl Manifest {
    /// Of a folder that `verb` makes; `layout` is raised when the folder's layout changes.
    pub fn new(verb: &'static str, layout: u32) -> Self {
        let empty = Self {
            verb,
            entries: Map::new(),
        };
        empty
            .with("schema", format!("truetwin.{verb}-folder/{layout}"))
            .with("version", env!("CARGO_PKG_VERSION"))
    }

    /// With one thing more that the pieces depend on.
    pub fn with(mut self, key: &str, value: impl Into<Value>) -> Self {
        self.entries.insert(key.into(), value.into());
        self
    }

    /// One of the things that the pieces depend on.
    pub fn get(&self, key: &str) -> Option<&Value> {
        self.entries.get(key)
    }

    /// Checksums of the pieces, once all are there.
    pub fn checksums(&self) -> Option<&Value> {
        self.entries.get(CHECKSUMS)
    }

    /// Without checksums.
    pub fn unfinished(mut self) -> Self {
        self.entries.shift_remove(CHECKSUMS);
        self
    }

    /// With the checksums of all pieces.
    pub(super) fn finished(self, checksums: Value) -> Self {
        self.with(CHECKSUMS, checksums)
    }

    /// What makes such folders.
    pub fn verb(&self) -> &'static str {
        self.verb
    }

    /// SHA-256 of all of it, in hexadecimal digits.
    pub(crate) fn checksum(&self) -> String {
        sha256(self.text().as_bytes())
    }

    /// As it stands in the folder.
    pub(super) fn text(&self) -> String {
        format!("{:#}\n", Value::Object(self.entries.clone()))
    }

    /// From the folder's text; `None` where it is none of this verb, whatever the layout.
    pub(super) fn parse(verb: &'static str, text: &str) -> Option<Self> {
        let Ok(Value::Object(entries)) = serde_json::from_str(text) else {
            return None;
        };
        let schema = entries.get("schema").and_then(Value::as_str)?;
        let ours = schema.starts_with(&format!("truetwin.{verb}-folder/"));
        ours.then_some(Self { verb, entries })
    }

    /// The first thing that `found` says otherwise, in words; `None` where both say the same, finished or not.
    pub fn differs(&self, found: &Self) -> Option<String> {
        let keys = self.entries.keys().chain(found.entries.keys());
        keys.filter(|key| *key != CHECKSUMS)
            .map(|key| (key, found.get(key), self.get(key)))
            .find(|(_, there, here)| there != here)
            .map(|(key, there, here)| {
                let (there, here) = (shown(there), shown(here));
                match there.chars().count().max(here.chars().count()) <= SHORT {
                    true => excerpt(&format!("{key} was {there}, now it is {here}")),
                    false => excerpt(&format!("{key} was another")),
                }
            })
    }
}

fn shown(value: Option<&Value>) -> String {
    match value {
        None | Some(Value::Null) => "not given".into(),
        Some(Value::String(text)) => text.clone(),
        Some(value) => value.to_string(),
    }
}

/// SHA-256 of a file that pieces depend on, in hexadecimal digits.
///
/// # Errors
///
/// A file that cannot be read.
pub fn checksum(path: &Path) -> Result<String, WorkError> {
    sha256_of(path).map_err(|error| WorkError::io(path, error))
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
        assert_eq!(differs(long), "network was another");
    }

    #[test]
    fn there_and_back_and_other_files_are_none_of_ours() {
        let text = manifest().text();
        assert_eq!(Manifest::parse("reproduce", &text), Some(manifest()));
        assert_eq!(Manifest::parse("withheld", &text), None);
        for text in ["", "[]", "{}", r#"{"schema": "truetwin.gap/1"}"#] {
            assert_eq!(Manifest::parse("reproduce", text), None, "{text}");
        }
    }
}
