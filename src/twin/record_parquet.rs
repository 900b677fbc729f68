//! Records in Parquet files: the same columns as in CSV, so the same rules and messages.

use super::CsvError;
use std::path::Path;

/// Without the feature, what to do instead.
#[cfg(not(feature = "parquet"))]
pub(super) fn csv_text(path: &Path) -> Result<String, CsvError> {
    Err(CsvError::Header {
        path: path.into(),
        problem: "this build reads no Parquet; install it with `--features parquet`, or save the record as CSV".into(),
    })
}

/// The file as the text of a CSV file; every number keeps its bits.
#[cfg(feature = "parquet")]
pub(super) fn csv_text(path: &Path) -> Result<String, CsvError> {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;

    let file = std::fs::File::open(path).map_err(|error| CsvError::Io {
        path: path.into(),
        error,
    })?;
    let wrong = |error: parquet::errors::ParquetError| CsvError::Header {
        path: path.into(),
        problem: format!("{error}; a record has columns of numbers, snappy or not compressed"),
    };
    let reader = SerializedFileReader::new(file).map_err(wrong)?;
    let schema = reader.metadata().file_metadata().schema_descr();
    let names: Vec<&str> = schema
        .columns()
        .iter()
        .map(|column| column.name())
        .collect();
    let mut text = names.join(",");
    text.push('\n');
    for row in reader.get_row_iter(None).map_err(wrong)? {
        let row = row.map_err(wrong)?;
        let cells: Vec<String> = (row.get_column_iter())
            .map(|(_, field)| match field {
                Field::Double(value) => value.to_string(),
                Field::Float(value) => f64::from(*value).to_string(),
                // Anything else that is no number is named by the checks of a cell.
                other => other.to_string().replace([',', '\n', '"'], " "),
            })
            .collect();
        text.push_str(&cells.join(","));
        text.push('\n');
    }
    Ok(text)
}
