//! Files that appear complete or not at all.

use super::StorageError;
pub(crate) use super::error::with_remedy;
use super::names::places_beside;
use super::unfinished::{Unfinished, file_beside, note_result};
use std::fmt::Display;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// Writes a new file.
pub(crate) fn write_new(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let file = filled(path, bytes)?.moved(|file| file.persist_noclobber(path));
    file.map(|_| ()).map_err(|error| error.error)
}

/// Writes a result whose place was free when the work began. What has taken it since stays: the result is kept beside it, or elsewhere where
/// nothing can be written, which the error says.
pub(crate) fn write_result<E: From<StorageError> + Display>(
    place: &Path,
    write: impl Fn(&Path) -> Result<(), E>,
) -> Result<(), E> {
    let Err(error) = write(place) else {
        note_result(place);
        return Ok(());
    };
    let is_taken = !is_free(place);
    let kept = match is_taken {
        true => places_beside(place).find(|path| is_free(path) && write(path).is_ok()),
        false => places_elsewhere(place).find(|path| write(path).is_ok()),
    };
    let Some(kept) = kept else {
        return Err(error);
    };
    note_result(&kept);
    let (place, problem) = (place.into(), error.to_string());
    Err(match is_taken {
        true => StorageError::Kept { place, kept },
        false => StorageError::Elsewhere { problem, kept },
    }
    .into())
}

fn is_free(path: &Path) -> bool {
    path.symlink_metadata().is_err()
}

/// Places for a file that cannot be written where it is due, which are free: in the folder of the call, then in that of temporary files.
fn places_elsewhere(place: &Path) -> impl Iterator<Item = PathBuf> {
    let name = place.file_name().unwrap_or_default();
    let there = [PathBuf::new(), std::env::temp_dir()].map(|folder| folder.join(name));
    there.into_iter().filter_map(|path| match is_free(&path) {
        true => Some(path),
        false => places_beside(&path).find(|path| is_free(path)),
    })
}

/// Keeps the text of an answer whose files could not be written; returns where.
pub(crate) fn keep_elsewhere(name: &str, text: &str) -> Option<PathBuf> {
    let is_written = |path: &PathBuf| write_new(path, text.as_bytes()).is_ok();
    let kept = places_elsewhere(name.as_ref()).find(is_written)?;
    note_result(&kept);
    Some(kept)
}

/// Writes a file, in place of an existing one.
pub(crate) fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let file = filled(path, bytes)?.moved(|file| file.persist(path));
    file.map(|_| ()).map_err(|error| error.error)
}

/// Creates a temporary file beside `path` with these bytes on the disk.
fn filled(path: &Path, bytes: &[u8]) -> io::Result<Unfinished<NamedTempFile>> {
    let file = file_beside(path)?;
    // The error of the temporary file's own `write_all` would name that file.
    file.get().as_file().write_all(bytes)?;
    file.get().as_file().sync_all()?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_result_is_kept_beside_what_has_taken_its_place() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("r.csv");
        let write =
            |path: &Path| write_new(path, b"result").map_err(|error| StorageError::io(path, error));
        write_result(&path, write).unwrap();
        fs::write(&path, "another's").unwrap();
        let error = write_result(&path, write).unwrap_err().to_string();
        assert!(error.contains("r-2.csv"), "{error}");
        assert_eq!(fs::read(&path).unwrap(), b"another's");
        assert_eq!(fs::read(place.path().join("r-2.csv")).unwrap(), b"result");
    }

    #[test]
    fn a_new_file_is_whole_readable_and_never_in_place_of_another() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("a.txt");
        write_new(&path, b"first").unwrap();
        let error = write_new(&path, b"second").unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::AlreadyExists);
        assert!(with_remedy(&error).contains("choose another name"));
        assert_eq!(fs::read(&path).unwrap(), b"first");
        assert_eq!(
            fs::read_dir(place.path()).unwrap().count(),
            1,
            "nothing is left over"
        );
        replace(&path, b"third").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"third");
        let plain = place.path().join("b.txt");
        fs::write(&plain, "").unwrap();
        let mode = |p: &Path| fs::metadata(p).unwrap().permissions();
        assert_eq!(mode(&path), mode(&plain));
    }
}
