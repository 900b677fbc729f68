//! Unpacking an archive from elsewhere: into its folder alone, and no more than a disk can take.

use crate::storage::untrusted::excerpt;
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
