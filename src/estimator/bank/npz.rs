//! Matrices in `.npz` archives, which may be cut off, a bomb, or no archive at all.
//!
//! A ZIP entry of a few bytes may claim any size, and an array any shape; both are believed only where they agree with each
//! other and with a limit, before memory is allocated.

use super::npy;
use crate::storage::untrusted::message;
use ndarray::Array2;
use std::io::{self, Cursor, Read, Seek};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

/// Returns the bytes of an archive, not compressed; the same matrices give the same bytes.
pub(super) fn archive(matrices: &[(&str, &Array2<f64>)]) -> io::Result<Vec<u8>> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(DateTime::default());
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, matrix) in matrices {
        archive.start_file(format!("{name}.npy"), options)?;
        npy::write(matrix, &mut archive)?;
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
        let matrix = npy::read(&mut entry, size);
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
