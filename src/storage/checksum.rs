//! Checksums of bytes and files.

use sha2::{Digest, Sha256};
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

/// Returns the SHA-256 of bytes, in hexadecimal digits.
pub(crate) fn sha256(bytes: &[u8]) -> String {
    let mut hash = Hashing::default();
    hash.add(bytes);
    hash.finish()
}

/// Returns the SHA-256 of a file, without reading it into memory.
pub(crate) fn sha256_of(path: &Path) -> io::Result<String> {
    let mut hash = Hashing::default();
    hash.add_all(&mut std::fs::File::open(path)?)?;
    Ok(hash.finish())
}

/// The SHA-256 of bytes that come in pieces.
#[derive(Clone, Default)]
pub(super) struct Hashing(Sha256);

impl Hashing {
    pub fn add(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    /// Adds everything up to the end.
    pub fn add_all(&mut self, from: &mut impl Read) -> io::Result<()> {
        let mut from = BufReader::new(from);
        while let piece @ [_, ..] = from.fill_buf()? {
            self.add(piece);
            let length = piece.len();
            from.consume(length);
        }
        Ok(())
    }

    /// The checksum, in hexadecimal digits.
    pub fn finish(self) -> String {
        let digest = self.0.finalize();
        digest.iter().map(|byte| format!("{byte:02x}")).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_in_pieces_have_the_checksum_of_the_whole() {
        let mut hash = Hashing::default();
        hash.add(b"ab");
        hash.add_all(&mut &b"c"[..]).unwrap();
        let known = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(
            (hash.finish().as_str(), sha256(b"abc").as_str()),
            (known, known)
        );
    }
}
