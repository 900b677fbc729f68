//! Files of a call as they are read, with the checksums of the bytes that were read.
//!
//! A result names its files by checksums. These are taken while a file is read, not afterwards: the file may be a pipe, or another one by
//! then. One entry is kept for each path.

use super::checksum::Hashing;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Checksums of the files that this process has read, by path; none for a pipe that is being read.
static READ: Mutex<BTreeMap<PathBuf, Option<String>>> = Mutex::new(BTreeMap::new());

fn read_files() -> MutexGuard<'static, BTreeMap<PathBuf, Option<String>>> {
    READ.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the SHA-256 of the bytes that were last read from a path, from its begin to its end.
pub(crate) fn checksum_of_read(path: &Path) -> Option<String> {
    read_files().get(path).cloned().flatten()
}

/// Opens a file for reading; says so where a link leads nowhere, and where a pipe was read before: its bytes are gone.
pub(crate) fn open(path: &Path) -> io::Result<File> {
    if is_pipe(path) && read_files().insert(path.into(), None).is_some() {
        let text = "it is a pipe, which can be read once";
        return Err(io::Error::new(io::ErrorKind::NotSeekable, text));
    }
    File::open(path).map_err(|error| match dangling(path) {
        Some(to) => {
            let text = format!("it is a link to {}, which does not exist", to.display());
            io::Error::new(error.kind(), text)
        }
        None => error,
    })
}

/// Returns whether what is read from a path is gone then.
fn is_pipe(path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        let kind = path.metadata().map(|data| data.file_type());
        kind.is_ok_and(|kind| kind.is_fifo() || kind.is_socket())
    }
    #[cfg(not(unix))]
    {
        let _ = path;
        false
    }
}

/// Returns where a link leads, if nothing is there.
pub(crate) fn dangling(path: &Path) -> Option<PathBuf> {
    match path.metadata() {
        Err(error) if error.kind() == io::ErrorKind::NotFound => path.read_link().ok(),
        _ => None,
    }
}

/// A file that is read once, from begin to end.
pub(crate) struct Reading {
    file: File,
    path: PathBuf,
    hash: Hashing,
}

impl Reading {
    /// Opens a file.
    pub fn open(path: &Path) -> io::Result<Self> {
        Ok(Self {
            file: open(path)?,
            path: path.into(),
            hash: Hashing::default(),
        })
    }

    /// Length that the system knows: none of a pipe or a device.
    pub fn length(&self) -> io::Result<u64> {
        Ok(self.file.metadata()?.len())
    }
}

impl Read for Reading {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let read = self.file.read(to)?;
        self.hash.add(&to[..read]);
        if read == 0 && !to.is_empty() {
            // A reader may ask again behind the end.
            let sum = self.hash.clone().finish();
            read_files().insert(self.path.clone(), Some(sum));
        }
        Ok(read)
    }
}

/// Notes the checksum of an open file that was read in another order than that of its bytes.
pub(crate) fn note_whole(path: &Path, file: &File) -> io::Result<()> {
    let mut file = file.try_clone()?;
    file.seek(SeekFrom::Start(0))?;
    let mut hash = Hashing::default();
    hash.add_all(&mut file)?;
    read_files().insert(path.into(), Some(hash.finish()));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::checksum::sha256;
    use super::*;

    /// The checksum is that of the bytes that were read, also where the file is another one by then.
    #[test]
    fn checksums_are_of_what_was_read() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("r.csv");
        std::fs::write(&path, "first").unwrap();
        let mut text = String::new();
        let mut reading = Reading::open(&path).unwrap();
        reading.read_to_string(&mut text).unwrap();
        assert_eq!(reading.read(&mut [0; 8]).unwrap(), 0);
        std::fs::write(&path, "second").unwrap();
        assert_eq!(checksum_of_read(&path), Some(sha256(b"first")));
        let file = open(&path).unwrap();
        note_whole(&path, &file).unwrap();
        assert_eq!(checksum_of_read(&path), Some(sha256(b"second")));
        assert_eq!(checksum_of_read(&place.path().join("other")), None);
    }

    #[cfg(unix)]
    #[test]
    fn links_to_nothing_are_told_as_such() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("link.csv");
        std::os::unix::fs::symlink("/nowhere", &path).unwrap();
        let error = open(&path).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::NotFound);
        assert!(error.to_string().contains("a link to /nowhere"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_is_read_once() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&path).status();
        if !made.is_ok_and(|status| status.success()) {
            return;
        }
        let writer = {
            let path = path.clone();
            std::thread::spawn(move || std::fs::write(path, "t,y\n").unwrap())
        };
        let mut text = String::new();
        let mut reading = Reading::open(&path).unwrap();
        reading.read_to_string(&mut text).unwrap();
        writer.join().unwrap();
        assert_eq!(checksum_of_read(&path), Some(sha256(b"t,y\n")));
        let again = Reading::open(&path).map(|_| ()).unwrap_err();
        assert!(again.to_string().contains("can be read once"), "{again}");
    }
}
