//! Places of outputs, checked before the work that fills them.

use super::StorageError;
use super::error::folder;
use super::names::is_reserved;
use super::reading::dangling;
use super::unfinished::{file_beside, sweep_beside};
use std::io;
use std::path::Path;

/// Refuses a place in a folder that does not exist or is none, and a name of unfinished files.
pub(crate) fn check_place(path: &Path) -> Result<(), StorageError> {
    if is_reserved(path) {
        return Err(StorageError::Reserved(path.into()));
    }
    match folder(path).metadata() {
        Ok(data) if data.is_dir() => Ok(()),
        Ok(_) => Err(StorageError::InFile(path.into())),
        Err(_) => Err(StorageError::NoParent(path.into())),
    }
}

/// Returns whether a place is taken. Leftovers of killed processes beside it are removed.
pub(crate) fn is_taken(path: &Path) -> Result<bool, StorageError> {
    if let Some(to) = dangling(path) {
        let path = path.into();
        return Err(StorageError::Dangling { path, to });
    }
    match path.symlink_metadata() {
        Ok(_) => return Ok(true),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        // As a name that is too long.
        Err(error) => return Err(StorageError::io(path, error)),
    }
    check_place(path)?;
    sweep_beside(path);
    Ok(false)
}

/// Checks that a file can be written at a place, by one beside it.
pub(crate) fn probe_file(path: &Path) -> Result<(), StorageError> {
    let bytes = path.as_os_str().as_encoded_bytes();
    if path.file_name().is_none() || bytes.ends_with(b"/") || bytes.ends_with(b"/.") {
        return Err(StorageError::NoFile(path.into()));
    }
    file_beside(path)
        .map(drop)
        .map_err(|error| StorageError::io(path, error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_that_cannot_be_written_are_told_before_the_work() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        assert!(!is_taken(&at("new")).unwrap() && is_taken(place.path()).unwrap());
        assert!(probe_file(&at("r.csv")).is_ok());
        for name in ["nd/", "nd/."] {
            let error = probe_file(&at(name)).unwrap_err();
            assert!(matches!(error, StorageError::NoFile(_)), "{error}");
        }
        let error = is_taken(&at(&"a".repeat(300))).unwrap_err().to_string();
        assert!(error.contains("choose a shorter name"), "{error}");
        let error = is_taken(&at(".truetwin-gap")).unwrap_err();
        assert!(matches!(error, StorageError::Reserved(_)), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn a_link_to_nothing_is_no_finished_output() {
        let place = tempfile::tempdir().unwrap();
        let link = place.path().join("out");
        std::os::unix::fs::symlink("/nowhere", &link).unwrap();
        let error = is_taken(&link).unwrap_err().to_string();
        assert!(
            error.contains("is a link to /nowhere, which does not exist"),
            "{error}"
        );
    }
}
