//! Output: standard output and error, and folders that appear complete.

use super::failure::Failure;
pub(super) use super::failure::say;
use super::terminal;
use crate::storage::NewFolder;
use crate::storage::files::with_remedy;
use crate::storage::place::{check_place, is_taken, probe_file};
use crate::storage::untrusted::{hidden, printable};
use serde_json::Value;
use std::io;
use std::path::{Path, PathBuf};

/// Prints a result; a closed pipe (`| head`) is no failure. Control characters from names and units are escaped.
pub(super) fn print(text: &str) -> Result<(), Failure> {
    let text = printable(text);
    let ends = if text.ends_with('\n') { "" } else { "\n" };
    match terminal::print(&format!("{text}{ends}")) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Failure::user(format!(
            "standard output: {}",
            with_remedy(&error)
        ))),
        _ => Ok(()),
    }
}

/// Prints one JSON object.
pub(super) fn print_json(value: &Value) -> Result<(), Failure> {
    print(&hidden_escaped(&format!("{value:#}")))
}

/// Escapes hidden characters in the strings of a JSON text.
fn hidden_escaped(json: &str) -> String {
    let mut text = String::with_capacity(json.len());
    for c in json.chars() {
        match hidden(c) && c != '\n' {
            true => text += &format!("\\u{:04x}", u32::from(c)),
            false => text.push(c),
        }
    }
    text
}

/// The name of a path in JSON; bytes that are no text are replacement characters there.
pub(super) fn name(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

/// Refuses an existing path or a missing parent folder, before the work starts; removes leftovers of killed processes there.
pub(super) fn check_new(path: &Path) -> Result<(), Failure> {
    match is_taken(path)? {
        true => Err(Failure::user(format!(
            "{} exists already; choose another --out or remove it",
            path.display()
        ))),
        false => Ok(()),
    }
}

/// As [`check_new`], for a file; checks that one can be written there.
pub(super) fn check_new_file(path: &Path) -> Result<(), Failure> {
    check_new(path)?;
    check_file(path)
}

/// Checks that a file can be written, before the work starts.
pub(super) fn check_file(path: &Path) -> Result<(), Failure> {
    check_place(path)?;
    Ok(probe_file(path)?)
}

/// Creates the output folder before the work starts, so that another run with the same `--out` is refused. It appears complete.
pub(super) fn new_folder(place: &Path) -> Result<NewFolder, Failure> {
    check_new(place)?;
    Ok(NewFolder::claim(place)?)
}

/// As [`new_folder`], for an option that may be absent.
pub(super) fn asked_folder(place: &Option<PathBuf>) -> Result<Option<NewFolder>, Failure> {
    place.as_deref().map(new_folder).transpose()
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
