//! NumPy's files: `.npy`, a text header and the numbers of one matrix; `.npz`, an archive of them.
//!
//! A file may be cut off, a bomb, or something else: a ZIP entry of a few bytes may claim any size, and an array any shape. Both are
//! believed only where they agree with each other and with a limit, before memory is allocated.
//!
//! Source: NumPy Enhancement Proposal 1, "A simple file format for NumPy arrays".

use crate::setting;
use crate::storage::untrusted::{MOST_NUMBERS, message};
use ndarray::{Array2, Ix2, Shape, ShapeBuilder};
use std::io::{self, Cursor, Read, Seek, Write};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

const MAGIC: &[u8] = b"\x93NUMPY";
/// Longest header that is read, in bytes; NumPy writes 128 for a matrix.
const LONGEST_HEADER: usize = 4096;
/// The header's length is a multiple of this.
const ALIGNMENT: usize = 64;

/// Returns the bytes of a matrix of 64-bit numbers, little-endian, in the order it has in memory.
pub(super) fn bytes(matrix: &Array2<f64>) -> io::Result<Vec<u8>> {
    let by_columns = !matrix.is_standard_layout() && matrix.t().is_standard_layout();
    let (order, numbers) = match by_columns {
        true => ("True", matrix.t()),
        false => ("False", matrix.view()),
    };
    let (rows, columns) = matrix.dim();
    let text =
        format!("{{'descr': '<f8', 'fortran_order': {order}, 'shape': ({rows}, {columns})}}");
    let before = MAGIC.len() + 4;
    let length = (before + text.len() + 1) / ALIGNMENT * ALIGNMENT + ALIGNMENT - before;
    let mut bytes = [MAGIC, &[1, 0], &(length as u16).to_le_bytes()].concat();
    writeln!(bytes, "{text:width$}", width = length - 1)?;
    bytes.extend(numbers.iter().flat_map(|v| v.to_le_bytes()));
    Ok(bytes)
}

/// Reads a matrix of 64-bit or 32-bit numbers from `size` bytes.
pub(super) fn read(from: &mut impl Read, size: u64) -> Result<Array2<f64>, String> {
    let (text, rest) = header_text(from, size)?;
    let header = ArrayHeader::parse(&text, rest)?;
    let mut bytes = Vec::new();
    let unread = |error: &dyn std::fmt::Display| format!("its numbers cannot be read: {error}");
    (from.take(rest).read_to_end(&mut bytes)).map_err(|error| unread(&error))?;
    let numbers = (bytes.chunks_exact(header.width))
        .map(header.number)
        .collect();
    Array2::from_shape_vec(header.shape, numbers).map_err(|error| unread(&error))
}

/// Reads the header's text; also returns the number of bytes after it.
fn header_text(from: &mut impl Read, size: u64) -> Result<(String, u64), String> {
    let short = |_| "it ends within its header".to_owned();
    let mut start = [0; 8];
    from.read_exact(&mut start).map_err(short)?;
    let width = match (&start[..6], start[6]) {
        (MAGIC, 1) => 2,
        (MAGIC, 2 | 3) => 4,
        _ => return Err("it is no array of NumPy".into()),
    };
    let mut length = [0; 4];
    from.read_exact(&mut length[..width]).map_err(short)?;
    let length = u32::from_le_bytes(length) as usize;
    if length > LONGEST_HEADER {
        return Err(format!(
            "a header of {length} bytes, at most {LONGEST_HEADER} are read"
        ));
    }
    let mut text = vec![0; length];
    from.read_exact(&mut text).map_err(short)?;
    let text = String::from_utf8(text).map_err(|error| error.to_string())?;
    Ok((text, size - (start.len() + width + length) as u64))
}

struct ArrayHeader {
    shape: Shape<Ix2>,
    /// Bytes of a number.
    width: usize,
    /// The number in these bytes.
    number: fn(&[u8]) -> f64,
}

impl ArrayHeader {
    /// Parses the header of a matrix that has `rest` bytes.
    fn parse(text: &str, rest: u64) -> Result<Self, String> {
        let no_matrix = || format!("its header \"{}\" describes no matrix", text.trim());
        // A matrix needs no other bracket than these two pairs.
        let inside = (text.trim().strip_prefix('{')).and_then(|text| text.strip_suffix('}'));
        let parts = inside.and_then(|text| text.split_once('('));
        let parts = parts.and_then(|(before, rest)| Some((before, rest.split_once(')')?)));
        let (before, (shape, after)) = parts.ok_or_else(no_matrix)?;
        let (mut descriptor, mut order) = (None, None);
        for entry in before.split(',').chain(after.split(',')).map(str::trim) {
            match entry.split_once(':').map(|(k, v)| (k.trim(), v.trim())) {
                Some(("'descr'", value)) => descriptor = Some(value),
                Some(("'fortran_order'", value)) => order = Some(value),
                Some(("'shape'", "")) => {}
                None if entry.is_empty() => {}
                _ => return Err(no_matrix()),
            }
        }
        let (width, number): (usize, fn(&[u8]) -> f64) = match descriptor.ok_or_else(no_matrix)? {
            "'<f8'" => (8, |b| b.try_into().map_or(f64::NAN, f64::from_le_bytes)),
            "'>f8'" => (8, |b| b.try_into().map_or(f64::NAN, f64::from_be_bytes)),
            "'<f4'" => (4, |b| {
                b.try_into().map_or(f32::NAN, f32::from_le_bytes).into()
            }),
            "'>f4'" => (4, |b| {
                b.try_into().map_or(f32::NAN, f32::from_be_bytes).into()
            }),
            other => return Err(format!("its numbers are {other}; give f8 or f4")),
        };
        let by_columns = match order {
            Some("True") => true,
            Some("False") => false,
            _ => return Err(no_matrix()),
        };
        let sizes: Vec<u64> = (shape.split(',').map(str::trim))
            .filter(|size| !size.is_empty())
            .map(|size| size.trim_end_matches('L').parse())
            .collect::<Result<_, _>>()
            .map_err(|error| format!("its shape ({shape}): {error}"))?;
        let &[rows, columns] = sizes.as_slice() else {
            return Err(format!("its shape ({shape}) is no matrix"));
        };
        match rows.checked_mul(columns) {
            Some(numbers) if numbers > MOST_NUMBERS as u64 => Err(format!(
                "its shape ({shape}) has more than {} numbers; keep such a bank in shards",
                setting::number(MOST_NUMBERS as f64)
            )),
            Some(numbers) if numbers * width as u64 == rest => {
                let shape = (rows as usize, columns as usize).set_f(by_columns);
                Ok(Self {
                    shape,
                    width,
                    number,
                })
            }
            _ => Err(format!(
                "its shape ({shape}) does not fit the {rest} bytes that it has"
            )),
        }
    }
}

/// Returns the bytes of an archive, not compressed; the same matrices give the same bytes.
pub(crate) fn archive(matrices: &[(&str, &Array2<f64>)]) -> io::Result<Vec<u8>> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(DateTime::default());
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, matrix) in matrices {
        archive.start_file(format!("{name}.npy"), options)?;
        archive.write_all(&bytes(matrix)?)?;
    }
    Ok(archive.finish()?.into_inner())
}

/// An archive to read from.
pub(super) struct Npz<R>(ZipArchive<R>);

impl<R: Read + Seek> Npz<R> {
    pub fn new(from: R) -> Result<Self, String> {
        let archive = ZipArchive::new(from).map_err(|error| error.to_string())?;
        Ok(Self(archive))
    }

    /// Reads the matrix of this name.
    pub fn matrix(&mut self, name: &str) -> Result<Array2<f64>, String> {
        let file = format!("{name}.npy");
        // Some writers leave the ending out.
        let index = (self.0.index_for_name(&file)).or_else(|| self.0.index_for_name(name));
        let index = index.ok_or_else(|| format!("it has no array {name}"))?;
        let entry = (self.0.by_index(index)).map_err(|error| format!("{name}: {error}"))?;
        let size = entry.size();
        // What is unpacked may be longer than the archive says: no more than that is read.
        let mut entry = io::BufReader::new(entry.take(size));
        let matrix = read(&mut entry, size);
        // The archive compares its checksum once nothing is left to read.
        let rest = entry.into_inner().into_inner().read(&mut [0]);
        (matrix.and_then(|matrix| match rest {
            Ok(0) => Ok(matrix),
            Ok(_) => Err("it is longer than the archive says".into()),
            Err(error) => Err(error.to_string()),
        }))
        .map_err(|problem| format!("{name}: {}", message(&problem)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    fn written(matrix: &Array2<f64>) -> Vec<u8> {
        bytes(matrix).unwrap()
    }

    fn read_all(bytes: &[u8]) -> Result<Array2<f64>, String> {
        read(&mut &bytes[..], bytes.len() as u64)
    }

    /// An array under this header.
    fn array(header: &str, numbers: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(numbers);
        bytes
    }

    #[test]
    fn matrices_come_back_in_both_orders() {
        let rows = array![[1.0, -0.0, 1e-300], [f64::MAX, 0.1 + 0.2, 7.0]];
        let mut columns = Array2::zeros((2, 3).f());
        columns.assign(&rows);
        for (matrix, order) in [(rows, "False"), (columns, "True")] {
            let bytes = written(&matrix);
            assert_eq!(bytes.len(), 128 + 48);
            let header = format!("{{'descr': '<f8', 'fortran_order': {order}, 'shape': (2, 3)}}");
            assert!(bytes[10..].starts_with(header.as_bytes()));
            let again = read_all(&bytes).unwrap();
            assert_eq!(again, matrix);
            assert_eq!(again[[0, 1]].to_bits(), (-0.0f64).to_bits());
        }
        assert_eq!(
            read_all(&written(&Array2::zeros((0, 5)))).unwrap().dim(),
            (0, 5)
        );
    }

    #[test]
    fn numbers_of_four_forms_are_read() {
        let value = 2.5f64;
        let forms: [(&str, Vec<u8>); 4] = [
            ("<f8", value.to_le_bytes().into()),
            (">f8", value.to_be_bytes().into()),
            ("<f4", (value as f32).to_le_bytes().into()),
            (">f4", (value as f32).to_be_bytes().into()),
        ];
        for (form, bytes) in forms {
            // As NumPy writes it, with a last comma.
            let header =
                format!("{{'descr': '{form}', 'fortran_order': False, 'shape': (1, 1), }} \n");
            assert_eq!(
                read_all(&array(&header, &bytes)).unwrap(),
                array![[value]],
                "{form}"
            );
        }
    }

    #[test]
    fn malformed_headers_are_refused() {
        let numbers = [0; 16];
        for (header, expected) in [
            (
                "{'descr': '<f8', 'fortran_order': False, 'shape': (1, 3), }",
                "does not fit the 16 bytes",
            ),
            (
                "{'descr': '<f8', 'fortran_order': False, 'shape': (2,), }",
                "no matrix",
            ),
            (
                "{'descr': '<f8', 'fortran_order': False, 'shape': (2, -1), }",
                "its shape",
            ),
            (
                "{'descr': '<f8', 'fortran_order': False, 'shape': (4294967296, 4294967296), }",
                "does not fit",
            ),
            (
                "{'descr': '<f8', 'fortran_order': False, 'shape': (1, 9000000000000), }",
                "keep such a bank",
            ),
            (
                "{'descr': '<i8', 'fortran_order': False, 'shape': (1, 2), }",
                "f8 or f4",
            ),
            (
                "{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (1, 2), }",
                "describes no matrix",
            ),
            (
                "{'descr': '<f8', 'fortran_order': 0, 'shape': (1, 2), }",
                "describes no matrix",
            ),
            ("{'descr': '<f8', 'shape': (1, 2), }", "describes no matrix"),
            (
                "{'other': 1, 'descr': '<f8', 'fortran_order': False, 'shape': (1, 2)}",
                "describes no matrix",
            ),
            ("((((", "describes no matrix"),
            ("", "describes no matrix"),
        ] {
            let message = read_all(&array(header, &numbers)).unwrap_err();
            assert!(message.contains(expected), "{header}: {message}");
        }
        let long = array(&" ".repeat(5000), &numbers);
        assert!(read_all(&long).unwrap_err().contains("at most 4096"));
        let whole = written(&array![[1.0, 2.0]]);
        for length in 0..128 {
            let message = read(&mut &whole[..length], whole.len() as u64).unwrap_err();
            assert_eq!(message, "it ends within its header", "{length}");
        }
        let cut = read(&mut &whole[..140], whole.len() as u64).unwrap_err();
        assert!(cut.contains("cannot be read"), "{cut}");
        assert!(
            read_all(b"PK\x03\x04 and so on")
                .unwrap_err()
                .contains("no array of NumPy")
        );
    }
}
