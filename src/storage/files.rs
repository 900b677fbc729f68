//! Files and folders that appear whole or not at all.

use sha2::{Digest, Sha256};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// How names of files and folders begin that are not in their place yet.
pub(crate) const PREFIX: &str = ".truetwin-";

/// Writes a new file: the bytes go to a temporary file beside it, which is then put in its place.
///
/// # Errors
///
/// What the system says; [`io::ErrorKind::AlreadyExists`] where the path is taken.
pub fn write_new(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let file = filled(path, bytes)?.persist_noclobber(path);
    file.map(|_| ()).map_err(|error| error.error)
}

/// As [`write_new`], but takes the place of a file that is there: for results that are made again.
pub fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let file = filled(path, bytes)?.persist(path);
    file.map(|_| ()).map_err(|error| error.error)
}

/// A temporary file beside `path` with these bytes on the disk.
fn filled(path: &Path, bytes: &[u8]) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // As any new file: the user's mask decides who may read it.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let file = builder.prefix(PREFIX).tempfile_in(folder(path));
    let mut file = file.map_err(without_path)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    Ok(file)
}

/// An error without the name of a temporary file, which says nothing to anybody.
fn without_path(error: io::Error) -> io::Error {
    match error.get_ref() {
        Some(_) => error.kind().into(),
        None => error,
    }
}

/// Removes the unfinished files that processes have left in a folder when they died; for folders that nobody writes to.
///
/// # Errors
///
/// What the system says.
pub fn sweep(folder: &Path) -> io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_name().to_string_lossy().starts_with(PREFIX) {
            std::fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

/// A folder that is filled beside its place and appears there whole.
#[derive(Debug)]
pub struct NewFolder {
    place: PathBuf,
    filling: tempfile::TempDir,
}

impl NewFolder {
    /// A folder that will be at `place`.
    pub fn new(place: &Path) -> io::Result<Self> {
        let mut builder = tempfile::Builder::new();
        let filling = builder.prefix(PREFIX).tempdir_in(folder(place));
        Ok(Self {
            filling: filling.map_err(without_path)?,
            place: place.into(),
        })
    }

    /// Where a file of the folder is written until then.
    pub fn file(&self, name: &str) -> PathBuf {
        self.filling.path().join(name)
    }

    /// Puts the folder in its place.
    pub fn finish(self) -> io::Result<()> {
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // A temporary folder is its maker's alone; a result is like any other folder.
            let mode = std::fs::Permissions::from_mode(0o755);
            std::fs::set_permissions(self.filling.path(), mode)?;
        }
        std::fs::rename(self.filling.path(), &self.place)?;
        // Moved away: nothing is left to remove.
        let _ = self.filling.keep();
        Ok(())
    }
}

/// SHA-256 of some bytes, in hexadecimal digits.
pub fn sha256(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// SHA-256 of a file, which is not in memory as a whole.
///
/// # Errors
///
/// What the system says.
pub fn sha256_of(path: &Path) -> io::Result<String> {
    let mut hash = Sha256::new();
    io::copy(&mut std::fs::File::open(path)?, &mut hash)?;
    let digest = hash.finalize();
    Ok(digest.iter().map(|byte| format!("{byte:02x}")).collect())
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
        io::ErrorKind::ReadOnlyFilesystem => "choose another place",
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            "make room, or choose another place"
        }
        io::ErrorKind::InvalidData => "save it as UTF-8 text",
        io::ErrorKind::Unsupported => "remove it, and put a file or folder of its own there",
        io::ErrorKind::FileTooLarge => "check that it is the file that you mean",
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
        replace(&path, b"third").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"third");
        let plain = place.path().join("b.txt");
        fs::write(&plain, "").unwrap();
        let mode = |p: &Path| fs::metadata(p).unwrap().permissions();
        assert_eq!(mode(&path), mode(&plain));
    }

    #[test]
    fn a_folder_appears_when_it_is_finished() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("out");
        let dropped = NewFolder::new(&path).unwrap();
        fs::write(dropped.file("a.txt"), "a").unwrap();
        drop(dropped);
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 0);
        let folder = NewFolder::new(&path).unwrap();
        fs::write(folder.file("a.txt"), "a").unwrap();
        assert!(!path.exists());
        folder.finish().unwrap();
        assert_eq!(fs::read(path.join("a.txt")).unwrap(), b"a");
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 1);
    }
}
