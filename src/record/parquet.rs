//! Records in Parquet files: the same columns as in CSV, so the same rules and messages.

use crate::record::RecordError;
use std::io::Read;
use std::path::Path;

/// Without the feature, what to do instead.
#[cfg(not(feature = "parquet"))]
pub(super) fn with_rows<T>(
    path: &Path,
    _: impl FnOnce(&mut dyn Read) -> Result<T, RecordError>,
) -> Result<T, RecordError> {
    Err(RecordError::file(
        path,
        "this build reads no Parquet; build it with the feature parquet, or save the record as CSV",
    ))
}

/// Has `read` read the file as the text of a CSV file; every number keeps its bits. One row is text at a time.
#[cfg(feature = "parquet")]
pub(super) fn with_rows<T>(
    path: &Path,
    read: impl FnOnce(&mut dyn Read) -> Result<T, RecordError>,
) -> Result<T, RecordError> {
    use crate::storage::reading::{note_whole, open};
    use parquet::file::reader::{FileReader, SerializedFileReader};

    let unread = |error| RecordError::io(path, error);
    let file = open(path).map_err(unread)?;
    let wrong = |error: parquet::errors::ParquetError| {
        let remedy = "a record has columns of numbers, snappy or not compressed";
        RecordError::file(path, format!("{error}; {remedy}"))
    };
    let reader = SerializedFileReader::new(file.try_clone().map_err(unread)?).map_err(wrong)?;
    let schema = reader.metadata().file_metadata().schema_descr();
    let names: Vec<String> = (schema.columns().iter())
        .map(|column| format!("\"{}\"", column.name().replace('"', "\"\"")))
        .collect();
    let header = names.join(",") + "\n";
    let rows = reader.get_row_iter(None).map_err(wrong)?;
    let mut text = Text {
        rows,
        row: header.into_bytes(),
        given: 0,
        error: None,
    };
    let outcome = read(&mut text);
    if let Some(error) = text.error {
        return Err(wrong(error));
    }
    note_whole(path, &file).map_err(unread)?;
    outcome
}

/// Rows as text, made when they are read.
#[cfg(feature = "parquet")]
struct Text<I> {
    rows: I,
    row: Vec<u8>,
    /// Bytes of the row that were read.
    given: usize,
    error: Option<parquet::errors::ParquetError>,
}

#[cfg(feature = "parquet")]
impl<I> Read for Text<I>
where
    I: Iterator<Item = Result<parquet::record::Row, parquet::errors::ParquetError>>,
{
    fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
        while self.given == self.row.len() {
            match self.rows.next() {
                None => return Ok(0),
                Some(Ok(row)) => self.row = line(&row).into_bytes(),
                Some(Err(error)) => {
                    self.error = Some(error);
                    return Ok(0);
                }
            }
            self.given = 0;
        }
        let length = to.len().min(self.row.len() - self.given);
        to[..length].copy_from_slice(&self.row[self.given..self.given + length]);
        self.given += length;
        Ok(length)
    }
}

#[cfg(feature = "parquet")]
fn line(row: &parquet::record::Row) -> String {
    use parquet::record::Field;

    let cells: Vec<String> = (row.get_column_iter())
        .map(|(_, field)| match field {
            Field::Double(value) => value.to_string(),
            Field::Float(value) => f64::from(*value).to_string(),
            Field::Null => String::new(),
            // Anything else that is no number is named by the checks of a cell.
            other => other.to_string().replace([',', '\n', '"'], " "),
        })
        .collect();
    cells.join(",") + "\n"
}
