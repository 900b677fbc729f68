//! Files of a call as they are read, with the checksums of the bytes that were read.
//!
//! A result names its files by checksums. These are taken while a file is read, not afterwards: the file may be a pipe, or another one by
//! then. One entry is kept for each path. What comes from a pipe is kept on the disk: a call may read a file several times.

use super::checksum::{Hashing, sha256_of};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Checksums of the files that this process has read, by path.
static READ: Mutex<BTreeMap<PathBuf, String>> = Mutex::new(BTreeMap::new());
/// Bytes that came from pipes, by path; none where a pipe is not at its end, or where there was no room for them.
static PIPES: Mutex<BTreeMap<PathBuf, Option<File>>> = Mutex::new(BTreeMap::new());

fn held<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the SHA-256 of the bytes that were last read from a path, from its begin to its end.
pub(crate) fn checksum_of_read(path: &Path) -> Option<String> {
    held(&READ).get(path).cloned()
}

/// Returns whether a file has other bytes than were read, or is gone; a pipe may be. Clocks are not asked.
pub(crate) fn has_changed(path: &Path) -> bool {
    let is_file = path.metadata().map_or(true, |data| data.is_file());
    let is_kept = is_file && !held(&PIPES).contains_key(path);
    is_kept && checksum_of_read(path).is_some_and(|read| sha256_of(path).ok() != Some(read))
}

/// Opens a file for reading, or what a pipe has given; says so where a link leads nowhere, and where the bytes of a pipe are gone.
pub(crate) fn open(path: &Path) -> io::Result<File> {
    if is_pipe(path)
        && let Some(kept) = held(&PIPES).get(path)
    {
        let Some(kept) = kept else {
            let text = "it is a pipe, which can be read once";
            return Err(io::Error::new(io::ErrorKind::NotSeekable, text));
        };
        let mut file = kept.try_clone()?;
        file.seek(SeekFrom::Start(0))?;
        return Ok(file);
    }
    File::open(path).map_err(|error| match link_to_nothing(path) {
        Some(text) => io::Error::new(error.kind(), text),
        None => error,
    })
}

/// Returns whether what is read from a path is gone then.
pub(crate) fn is_pipe(path: &Path) -> bool {
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
pub(super) fn dangling(path: &Path) -> Option<PathBuf> {
    match path.metadata() {
        Err(error) if error.kind() == io::ErrorKind::NotFound => path.read_link().ok(),
        _ => None,
    }
}

/// Returns what is wrong with a link that leads nowhere.
pub(crate) fn link_to_nothing(path: &Path) -> Option<String> {
    let to = dangling(path)?;
    Some(format!(
        "it is a link to {}, which does not exist",
        to.display()
    ))
}

/// A file that is read once, from begin to end.
pub(crate) struct Reading {
    file: File,
    path: PathBuf,
    hash: Hashing,
    /// Keeps what a pipe gives, in a file without a name.
    kept: Option<File>,
}

impl Reading {
    /// Opens a file.
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = open(path)?;
        let is_new = is_pipe(path) && !held(&PIPES).contains_key(path);
        if is_new {
            held(&PIPES).insert(path.into(), None);
        }
        Ok(Self {
            file,
            path: path.into(),
            hash: Hashing::default(),
            kept: is_new.then(tempfile::tempfile).and_then(Result::ok),
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
        self.kept = (self.kept.take()).filter(|mut kept| kept.write_all(&to[..read]).is_ok());
        if read == 0 && !to.is_empty() {
            if let Some(kept) = self.kept.take() {
                held(&PIPES).insert(self.path.clone(), Some(kept));
            }
            // A reader may ask again behind the end.
            let sum = self.hash.clone().finish();
            held(&READ).insert(self.path.clone(), sum);
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
    held(&READ).insert(path.into(), hash.finish());
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
        assert!(!has_changed(&path));
        std::fs::write(&path, "second").unwrap();
        assert_eq!(checksum_of_read(&path), Some(sha256(b"first")));
        assert!(has_changed(&path));
        let file = open(&path).unwrap();
        note_whole(&path, &file).unwrap();
        assert_eq!(checksum_of_read(&path), Some(sha256(b"second")));
        assert!(!has_changed(&path));
        std::fs::remove_file(&path).unwrap();
        assert!(has_changed(&path));
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
    fn what_a_pipe_has_given_can_be_read_again() {
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
        for _ in 0..2 {
            let mut text = String::new();
            let mut reading = Reading::open(&path).unwrap();
            reading.read_to_string(&mut text).unwrap();
            assert_eq!(text, "t,y\n");
            assert_eq!(checksum_of_read(&path), Some(sha256(b"t,y\n")));
            assert!(!has_changed(&path));
        }
        writer.join().unwrap();
    }
}
