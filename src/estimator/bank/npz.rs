//! Arrays out of an `.npz` archive that may be cut off, a bomb, or no archive at all.
//!
//! A ZIP entry of a few bytes may claim any size, and an array any shape; both are believed only where they agree with each
//! other and with a limit, before memory is asked for.

use crate::storage::untrusted::{MESSAGE, MOST_NUMBERS, one_line};
use ndarray::Array2;
use ndarray_npy::ReadNpyExt;
use std::io::{Cursor, Read, Seek};
use zip::ZipArchive;

/// Longest header of an array, in bytes; NumPy writes 128 of them for a matrix.
const MOST_HEADER: usize = 4096;

/// An archive that is being read.
pub(super) struct Npz<R>(ZipArchive<R>);

impl<R: Read + Seek> Npz<R> {
    /// Of a file's bytes.
    pub fn new(from: R) -> Result<Self, String> {
        let archive = ZipArchive::new(from).map_err(|error| error.to_string())?;
        Ok(Self(archive))
    }

    /// The matrix of this name, of 64 or 32 bits.
    pub fn matrix(&mut self, name: &str) -> Result<Array2<f64>, String> {
        let file = format!("{name}.npy");
        // Some writers leave the ending out.
        let index = (self.0.index_for_name(&file)).or_else(|| self.0.index_for_name(name));
        let index = index.ok_or_else(|| format!("it has no array {name}"))?;
        let entry = (self.0.by_index(index)).map_err(|error| format!("{name}: {error}"))?;
        let size = entry.size();
        let wrong = |problem: String| format!("{name}: {}", one_line(&problem, MESSAGE));
        // What is unpacked may be longer than the archive says: no more than that is read.
        let mut entry = entry.take(size);
        let (header, bits) = header(&mut entry, size).map_err(wrong)?;
        let whole = Cursor::new(header).chain(entry);
        let read = match bits {
            64 => Array2::<f64>::read_npy(whole),
            _ => Array2::<f32>::read_npy(whole).map(|array| array.mapv(f64::from)),
        };
        read.map_err(|error| wrong(error.to_string()))
    }
}

/// The bytes before the numbers, and how many bits a number has; checked against the entry's `size` in bytes.
fn header(from: &mut impl Read, size: u64) -> Result<(Vec<u8>, u64), String> {
    let short = |_| "it ends within its header".to_owned();
    let mut bytes = vec![0; 10];
    from.read_exact(&mut bytes).map_err(short)?;
    let length = match (&bytes[..6], bytes[6]) {
        (b"\x93NUMPY", 1) => usize::from(u16::from_le_bytes([bytes[8], bytes[9]])),
        (b"\x93NUMPY", 2 | 3) => {
            bytes.extend([0; 2]);
            from.read_exact(&mut bytes[10..]).map_err(short)?;
            u32::from_le_bytes([bytes[8], bytes[9], bytes[10], bytes[11]]) as usize
        }
        _ => return Err("it is no array of NumPy".into()),
    };
    if length > MOST_HEADER {
        return Err(format!(
            "a header of {length} bytes, at most {MOST_HEADER} are read"
        ));
    }
    let before = bytes.len();
    bytes.resize(before + length, 0);
    from.read_exact(&mut bytes[before..]).map_err(short)?;
    let text = str::from_utf8(&bytes[before..]).map_err(|error| error.to_string())?;
    let bits = described(text, size - bytes.len() as u64)?;
    Ok((bytes, bits))
}

/// Bits of a number, of a header that describes a matrix of `rest` bytes.
fn described(text: &str, rest: u64) -> Result<u64, String> {
    // The library's parser descends into brackets: one pair of each kind is what a matrix has.
    let count = |open: char| text.matches(open).count();
    if count('(') != 1 || count('{') != 1 || count('[') != 0 {
        return Err(format!("its header \"{text}\" describes no matrix"));
    }
    let bits = match (text.contains("f8'"), text.contains("f4'")) {
        (true, false) => 64,
        (false, true) => 32,
        _ => return Err(format!("its header \"{text}\" names no f8 or f4")),
    };
    let inside = text.split(['(', ')']).nth(1).unwrap_or_default();
    let sizes: Vec<u64> = (inside.split(','))
        .filter(|part| !part.trim().is_empty())
        .map(|part| part.trim().trim_end_matches('L').parse())
        .collect::<Result<_, _>>()
        .map_err(|error| format!("its shape ({inside}): {error}"))?;
    let numbers = sizes.iter().try_fold(1u64, |all, n| all.checked_mul(*n));
    match numbers {
        Some(numbers) if sizes.len() != 2 => Err(format!(
            "its shape ({inside}) is no matrix, {numbers} numbers"
        )),
        Some(numbers) if numbers > MOST_NUMBERS as u64 => Err(format!(
            "its shape ({inside}) has more than {MOST_NUMBERS} numbers; keep such a bank in shards"
        )),
        Some(numbers) if numbers * bits / 8 == rest => Ok(bits),
        _ => Err(format!(
            "its shape ({inside}) does not fit the {rest} bytes that it has"
        )),
    }
}
