//! Files that appear whole or not at all, and never in place of another.

use std::io::{self, Write};
use std::path::Path;

/// Writes a new file: the bytes go to a temporary file beside it, which is then put in its place.
///
/// # Errors
///
/// What the system says; [`io::ErrorKind::AlreadyExists`] where the path is taken.
pub fn write_new(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // As any new file: the user's mask decides who may read it.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut file = builder.prefix(".truetwin-").tempfile_in(folder(path))?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist_noclobber(path)
        .map(|_| ())
        .map_err(|error| error.error)
}

/// The folder that a path lies in.
pub fn folder(path: &Path) -> &Path {
    path.parent()
        .filter(|parent| !parent.as_os_str().is_empty())
        .unwrap_or(Path::new("."))
}

/// An error of the system with what can be done about it.
pub fn with_remedy(error: &io::Error) -> String {
    let remedy = match error.kind() {
        io::ErrorKind::NotFound => "check the path",
        io::ErrorKind::IsADirectory => "name a file, not a folder",
        io::ErrorKind::PermissionDenied => "change its permissions, or choose another place",
        io::ErrorKind::AlreadyExists => "choose another name, or remove it",
        io::ErrorKind::StorageFull => "make room, or choose another place",
        io::ErrorKind::InvalidData => "save it as UTF-8 text",
        _ => "check the path and the disk",
    };
    format!("{error}; {remedy}")
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
        let plain = place.path().join("b.txt");
        fs::write(&plain, "").unwrap();
        let mode = |p: &Path| fs::metadata(p).unwrap().permissions();
        assert_eq!(mode(&path), mode(&plain));
    }
}
