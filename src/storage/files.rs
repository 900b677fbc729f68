//! Files that appear complete or not at all.

pub(crate) use super::error::{folder, with_remedy};
use super::unfinished::{Unfinished, file_beside};
use std::io::{self, Write};
use std::path::Path;
use tempfile::NamedTempFile;

/// Writes a new file.
pub(crate) fn write_new(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let file = filled(path, bytes)?.moved(|file| file.persist_noclobber(path));
    file.map(|_| ()).map_err(|error| error.error)
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
