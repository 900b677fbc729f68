//! Bounded, terminal-safe readers for untrusted input.
//!
//! Files may be cut off, endless, or made to harm. Every reader takes a limit that is far beyond honest files, so that memory
//! is bounded whatever lies under a path; and what a file says about itself is shown without what steers a terminal.

mod keyed;
mod rows;
mod show;

pub(crate) use keyed::{Keyed, all_keyed, keyed};
pub(crate) use rows::Rows;
pub(crate) use show::{
    check_name, check_names, excerpt, hidden, line, message, one_line, printable, quoted,
    short_words,
};

use super::reading::Reading;
use std::io::{self, Read};
use std::path::Path;

/// Most numbers that one file may hold, 4 GB of them: what is larger is kept in shards, or in several records.
pub(crate) const MOST_NUMBERS: usize = 500_000_000;

/// The bytes of a file, `most` of them; a longer one is refused, also one that has no end.
pub(crate) fn read(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let file = Reading::open(path)?;
    // Of a pipe or a device the system knows no length.
    let length = file.length()?;
    let mut bytes = Vec::new();
    if length <= most {
        bytes.reserve_exact(length as usize);
        file.take(most + 1).read_to_end(&mut bytes)?;
    }
    match length.max(bytes.len() as u64) > most {
        true => {
            let text = format!("longer than {}, the limit of such a file", size(most));
            Err(io::Error::new(io::ErrorKind::FileTooLarge, text))
        }
        false => Ok(bytes),
    }
}

/// As [`read`], for text.
pub(crate) fn read_text(path: &Path, most: u64) -> io::Result<String> {
    text(read(path, most)?)
}

/// As [`read`], for files that this program keeps in a folder of its own: only a plain file is one of them, and no link leads
/// out of the folder.
pub(crate) fn read_kept(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    check_file(path)?;
    read(path, most)
}

/// Checks whether a file of a folder of our own is a plain file, and no link out of it.
pub(crate) fn check_file(path: &Path) -> io::Result<()> {
    match path.symlink_metadata()?.is_file() {
        true => Ok(()),
        false => Err(not_plain("it is no plain file")),
    }
}

/// As [`read_kept`], for text.
pub(crate) fn read_kept_text(path: &Path, most: u64) -> io::Result<String> {
    text(read_kept(path, most)?)
}

/// Checks whether a part of a folder of our own is a folder, and no link out of it.
pub(crate) fn check_folder(path: &Path) -> io::Result<()> {
    match path.symlink_metadata()?.is_dir() {
        true => Ok(()),
        false => Err(not_plain("it is no folder of its own")),
    }
}

fn not_plain(what: &str) -> io::Error {
    let text = format!("{what}, but a link or something else");
    io::Error::new(io::ErrorKind::Unsupported, text)
}

fn text(bytes: Vec<u8>) -> io::Result<String> {
    let wrong = |_| io::Error::new(io::ErrorKind::InvalidData, "it is no UTF-8 text");
    String::from_utf8(bytes).map_err(wrong)
}

/// A round number of bytes, for people.
fn size(bytes: u64) -> String {
    match bytes {
        b if b >= 1 << 30 => format!("{} GiB", b >> 30),
        b if b >= 1 << 20 => format!("{} MiB", b >> 20),
        b => format!("{b} bytes"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_too_long_or_endless_is_refused() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("a.txt");
        std::fs::write(&path, [b'a'; 10]).unwrap();
        assert_eq!(read(&path, 10).unwrap().len(), 10);
        let error = read(&path, 9).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::FileTooLarge);
        assert!(error.to_string().contains("9 bytes"), "{error}");
        assert!(crate::storage::files::with_remedy(&error).contains("; "));
        #[cfg(unix)]
        {
            let endless = read(Path::new("/dev/zero"), 1 << 20).unwrap_err();
            assert!(endless.to_string().contains("1 MiB"), "{endless}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_are_no_files_of_ours() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        std::fs::write(at("a.txt"), "a").unwrap();
        std::os::unix::fs::symlink(at("a.txt"), at("link")).unwrap();
        std::os::unix::fs::symlink(place.path(), at("folder")).unwrap();
        assert_eq!(read_kept_text(&at("a.txt"), 10).unwrap(), "a");
        for odd in [at("link"), "/dev/zero".into()] {
            let error = read_kept(&odd, 10).unwrap_err().to_string();
            assert!(error.contains("no plain file"), "{error}");
        }
        assert!(check_folder(place.path()).is_ok());
        assert!(check_folder(&at("folder")).is_err());
    }
}
