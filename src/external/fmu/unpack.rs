//! Unpacking an archive from elsewhere: into its folder alone, and no more than a disk can take.

use crate::storage::untrusted::excerpt;
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Read, Seek};
use std::path::Path;
use zip::ZipArchive;

/// Most files and folders of an FMU: large ones bring some thousand resources along.
const MOST_ENTRIES: usize = 100_000;
/// Most bytes that an FMU unpacks to.
pub(super) const MOST_BYTES: u64 = 1 << 32;

/// Unpacks an archive into `folder`, `most` bytes at most.
///
/// Refused are more entries or bytes than that, whatever the archive says about their number; names that lead out of the
/// folder, absolute ones, names that stand there twice, and links. Nothing of such an archive is used.
pub(super) fn unpack(from: impl Read + Seek, folder: &Path, most: u64) -> Result<(), String> {
    let archive = ZipArchive::new(from).map_err(|error| error.to_string())?;
    let directory = archive.central_directory_start();
    let mut from = archive.into_inner();
    // The library keeps the last of two entries with one name.
    if let Some(name) = repeated(&mut from, directory).map_err(|error| error.to_string())? {
        return Err(format!("it has two entries {}", excerpt(&name)));
    }
    let mut archive = ZipArchive::new(from).map_err(|error| error.to_string())?;
    if archive.len() > MOST_ENTRIES {
        let entries = archive.len();
        return Err(format!(
            "{entries} files, at most {MOST_ENTRIES} are unpacked"
        ));
    }
    let mut left = most;
    for index in 0..archive.len() {
        let mut entry = archive.by_index(index).map_err(|error| error.to_string())?;
        let name = excerpt(entry.name());
        let failed = |error: io::Error| format!("{name}: {error}");
        // The library takes the root off an absolute name.
        let absolute = entry.name().starts_with(['/', '\\']);
        let Some(path) = entry.enclosed_name().filter(|_| !absolute) else {
            return Err(format!("its entry {name} leads out of the archive"));
        };
        if entry.is_symlink() {
            return Err(format!("its entry {name} is a link"));
        }
        let path = folder.join(path);
        if entry.is_dir() {
            fs::create_dir_all(&path).map_err(failed)?;
            continue;
        }
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent).map_err(failed)?;
        }
        let mut file = File::create_new(&path).map_err(failed)?;
        // What an entry says of its size need not be true: bytes are counted as they come.
        let written = io::copy(&mut entry.by_ref().take(left + 1), &mut file).map_err(failed)?;
        if written > left {
            return Err(format!(
                "it unpacks to more than {} MiB",
                most.div_ceil(1 << 20)
            ));
        }
        left -= written;
    }
    Ok(())
}

/// Returns a name that stands twice in the directory of an archive, which begins at this byte.
fn repeated(from: &mut (impl Read + Seek), directory: u64) -> io::Result<Option<String>> {
    let mut from = io::BufReader::new(from);
    from.seek(io::SeekFrom::Start(directory))?;
    let mut names = BTreeSet::new();
    loop {
        let mut head = [0; 46];
        // Behind the last entry is the end of the directory, which may be shorter.
        if from.read_exact(&mut head[..4]).is_err() || !head.starts_with(b"PK\x01\x02") {
            return Ok(None);
        }
        from.read_exact(&mut head[4..])?;
        let length = |at: usize| u16::from_le_bytes([head[at], head[at + 1]]);
        let mut name = vec![0; length(28).into()];
        from.read_exact(&mut name)?;
        from.seek_relative(i64::from(length(30)) + i64::from(length(32)))?;
        let text = String::from_utf8_lossy(&name).into_owned();
        if !names.insert(name) {
            return Ok(Some(text));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Cursor, Write};
    use zip::ZipWriter;
    use zip::write::SimpleFileOptions;

    fn packed(fill: impl FnOnce(&mut ZipWriter<Cursor<Vec<u8>>>)) -> Cursor<Vec<u8>> {
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        fill(&mut archive);
        Cursor::new(archive.finish().unwrap().into_inner())
    }

    fn entry(name: &str, bytes: &[u8]) -> Cursor<Vec<u8>> {
        packed(|archive| {
            let options = SimpleFileOptions::default();
            archive.start_file(name, options).unwrap();
            archive.write_all(bytes).unwrap();
        })
    }

    /// The message, and what lies beside the folder afterwards.
    fn refused(archive: Cursor<Vec<u8>>) -> String {
        let place = tempfile::tempdir().unwrap();
        let folder = place.path().join("in");
        fs::create_dir(&folder).unwrap();
        let message = unpack(archive, &folder, 1 << 20).unwrap_err();
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 1, "{message}");
        assert!(!message.contains('\n'), "{message}");
        message
    }

    #[test]
    fn nothing_is_written_outside() {
        for name in ["../x", "a/../../x", "/tmp/truetwin-x", "a/b/../../../x"] {
            let message = refused(entry(name, b"x"));
            assert!(message.contains("leads out"), "{message}");
        }
        let linked = packed(|archive| {
            let options = SimpleFileOptions::default();
            archive.add_symlink("link", "..", options).unwrap();
            archive.start_file("link/x", options).unwrap();
        });
        assert!(refused(linked).contains("is a link"));
    }

    /// Which of two entries counts is up to who reads them.
    #[test]
    fn a_name_stands_once() {
        let twice = packed(|archive| {
            for name in ["one.txt", "two.txt"] {
                archive
                    .start_file(name, SimpleFileOptions::default())
                    .unwrap();
            }
        });
        let mut bytes = twice.into_inner();
        while let Some(at) = bytes.windows(7).position(|w| w == b"two.txt") {
            bytes[at..at + 7].copy_from_slice(b"one.txt");
        }
        let message = refused(Cursor::new(bytes));
        assert!(message.contains("two entries one.txt"), "{message}");
    }

    #[test]
    fn bombs_are_refused() {
        let bomb = entry("zeros", &vec![0; 3 << 20]);
        assert!(bomb.get_ref().len() < 1 << 13);
        assert!(refused(bomb.clone()).contains("more than 1 MiB"));
        // The same, saying that it unpacks to 16 bytes.
        let mut lying = bomb.into_inner();
        let size = (3u32 << 20).to_le_bytes();
        while let Some(at) = lying.windows(4).position(|w| w == size) {
            lying[at..at + 4].copy_from_slice(&16u32.to_le_bytes());
        }
        refused(Cursor::new(lying));
    }

    #[test]
    fn others_are_unpacked() {
        let place = tempfile::tempdir().unwrap();
        unpack(entry("resources/a.txt", b"a"), place.path(), 1).unwrap();
        let text = fs::read_to_string(place.path().join("resources/a.txt"));
        assert_eq!(text.unwrap(), "a");
    }
}
