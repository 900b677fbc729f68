//! Output: standard output and error, and folders that appear complete.

use super::failure::Failure;
pub(super) use super::say::say;
use crate::storage::files::{folder, with_remedy};
use crate::storage::untrusted::{hidden, printable};
use crate::storage::{self, StorageError, sweep_beside};
use serde_json::Value;
use std::borrow::Cow;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Prints a result; a closed pipe (`| head`) is no failure. Control characters from names and units are escaped.
pub(super) fn print(text: &str) -> Result<(), Failure> {
    let text = printable(text);
    let mut out = io::stdout().lock();
    let ends = if text.ends_with('\n') { "" } else { "\n" };
    match write!(out, "{text}{ends}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Failure::user(format!(
            "standard output: {}",
            with_remedy(&error)
        ))),
        _ => Ok(()),
    }
}

/// Prints one JSON object.
pub(super) fn print_json(value: &Value) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(value).map_err(Failure::internal)?;
    print(&hidden_escaped(&text))
}

/// Escapes hidden characters in the strings of a JSON text.
fn hidden_escaped(json: &str) -> Cow<'_, str> {
    let odd = |c: char| hidden(c) && c != '\n';
    if !json.contains(odd) {
        return Cow::Borrowed(json);
    }
    let mut text = String::with_capacity(json.len() + 16);
    for c in json.chars() {
        if odd(c) {
            text.push_str(&format!("\\u{:04x}", u32::from(c)))
        } else {
            text.push(c)
        }
    }
    Cow::Owned(text)
}

/// Refuses an existing path or a missing parent folder, before the work starts; removes leftovers of killed processes there.
pub(super) fn check_new(path: &Path) -> Result<(), Failure> {
    let name = path.display();
    if fs::symlink_metadata(path).is_ok() {
        return Err(Failure::user(format!(
            "{name} exists already; choose another --out or remove it"
        )));
    }
    check_folder(path)?;
    sweep_beside(path);
    Ok(())
}

/// Refuses a missing parent folder, before the work starts.
pub(super) fn check_folder(path: &Path) -> Result<(), Failure> {
    if folder(path).is_dir() {
        Ok(())
    } else {
        Err(StorageError::NoParent { path: path.into() }.into())
    }
}

/// An output folder that appears complete: it is filled beside its place and then moved.
pub(super) struct NewFolder {
    place: PathBuf,
    filling: storage::NewFolder,
}

impl NewFolder {
    /// Creates the folder before the work starts, so that another run with the same `--out` is refused.
    pub fn new(place: &Path) -> Result<Self, Failure> {
        check_new(place)?;
        Ok(Self {
            filling: storage::NewFolder::claim(place)?,
            place: place.into(),
        })
    }

    /// As [`new`](Self::new), for an option that may be absent.
    pub fn asked(place: &Option<PathBuf>) -> Result<Option<Self>, Failure> {
        place.as_deref().map(Self::new).transpose()
    }

    /// Path of a file while the folder is filled.
    pub fn file(&self, name: &str) -> PathBuf {
        self.filling.file(name)
    }

    /// Writes an indented JSON object.
    pub fn write_json(&self, name: &str, value: &Value) -> Result<(), Failure> {
        let text = serde_json::to_string_pretty(value).map_err(Failure::internal)?;
        self.write(name, &text)
    }

    pub fn write(&self, name: &str, text: &str) -> Result<(), Failure> {
        fs::write(self.file(name), text)
            .map_err(|error| StorageError::io(&self.place.join(name), error).into())
    }

    /// Moves the folder to its place.
    pub fn finish(self) -> Result<(), Failure> {
        (self.filling.finish()).map_err(|error| StorageError::io(&self.place, error).into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn hidden_characters_survive_json_as_escapes() {
        let value = json!({ "unit": "\u{9b}31m \u{202e} \u{1b}[2J µ" });
        let text = serde_json::to_string_pretty(&value).unwrap();
        let shown = hidden_escaped(&text);
        assert!(!shown.contains(|c| hidden(c) && c != '\n'), "{shown:?}");
        assert_eq!(serde_json::from_str::<Value>(&shown).unwrap(), value);
    }
}
