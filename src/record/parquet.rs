//! Records in Parquet files: the same columns as in CSV, so the same rules and messages; a header stands for row 1. Times are time stamps.

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
    let (mut names, mut units) = (vec![], vec![]);
    for column in schema.columns() {
        names.push(format!("\"{}\"", column.name().replace('"', "\"\"")));
        units.push(times::unit(column).map_err(|problem| RecordError::file(path, problem))?);
    }
    let header = names.join(",") + "\n";
    let rows = reader.get_row_iter(None).map_err(wrong)?;
    let mut text = Text {
        rows,
        units,
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
    /// Nanoseconds that a count of a column of times stands for.
    units: Vec<Option<i128>>,
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
                Some(Ok(row)) => self.row = line(&row, &self.units).into_bytes(),
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
fn line(row: &parquet::record::Row, units: &[Option<i128>]) -> String {
    use parquet::record::Field;

    let cell = |((_, field), unit): ((&String, &Field), &Option<i128>)| {
        let stamp = unit.and_then(|unit| times::stamp(field, unit));
        stamp.unwrap_or_else(|| match field {
            // With an exponent where it is very large or small.
            Field::Double(value) => format!("{value:?}"),
            Field::Float(value) => format!("{:?}", f64::from(*value)),
            Field::Null => String::new(),
            // Anything else that is no number is named by the checks of a cell.
            other => other.to_string().replace([',', '\n', '"'], " "),
        })
    };
    let cells: Vec<String> = row.get_column_iter().zip(units).map(cell).collect();
    cells.join(",") + "\n"
}

/// Columns of times.
#[cfg(feature = "parquet")]
mod times {
    use crate::setting::number;
    use crate::storage::untrusted::excerpt;
    use jiff::Timestamp;
    use parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type};
    use parquet::record::Field;
    use parquet::schema::types::ColumnDescriptor;
    use std::time::Duration;

    /// Nanoseconds of a count; `None` of a column that holds no times. Those of INT96 lose what is below a millisecond, and are refused.
    pub(super) fn unit(column: &ColumnDescriptor) -> Result<Option<i128>, String> {
        let unit = match (column.logical_type_ref(), column.converted_type()) {
            _ if column.physical_type() == Type::INT96 => {
                let name = excerpt(column.name());
                let remedy = "save it as a timestamp of milliseconds, microseconds or nanoseconds";
                return Err(format!("column {name} is of the old type INT96; {remedy}"));
            }
            (Some(LogicalType::Timestamp(of)), _) => of_unit(&of.unit),
            (Some(LogicalType::Time(of)), _) => of_unit(&of.unit),
            (_, ConvertedType::TIMESTAMP_MILLIS | ConvertedType::TIME_MILLIS) => {
                Duration::from_millis(1)
            }
            (_, ConvertedType::TIMESTAMP_MICROS | ConvertedType::TIME_MICROS) => {
                Duration::from_micros(1)
            }
            (_, ConvertedType::DATE) => Duration::from_hours(24),
            _ => return Ok(None),
        };
        Ok(Some(unit.as_nanos().cast_signed()))
    }

    fn of_unit(unit: &TimeUnit) -> Duration {
        match unit {
            TimeUnit::MILLIS => Duration::from_millis(1),
            TimeUnit::MICROS => Duration::from_micros(1),
            TimeUnit::NANOS => Duration::from_nanos(1),
        }
    }

    /// A time as text that is exact, of a day or of the first of 1970; `None` of a cell that is no count.
    pub(super) fn stamp(field: &Field, unit: i128) -> Option<String> {
        let count = match *field {
            Field::Long(n)
            | Field::TimestampMillis(n)
            | Field::TimestampMicros(n)
            | Field::TimeMicros(n) => i128::from(n),
            Field::Int(n) | Field::TimeMillis(n) | Field::Date(n) => i128::from(n),
            _ => return None,
        };
        let stamp = Timestamp::from_nanosecond(count * unit).map(|stamp| stamp.to_string());
        Some(stamp.unwrap_or_else(|_| format!("{} beyond the calendar", number(count as f64))))
    }
}

#[cfg(all(test, feature = "parquet"))]
mod tests {
    use crate::record::{Record, RecordError};
    use parquet::data_type::{DataType, DoubleType, Int64Type};
    use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
    use parquet::schema::parser::parse_message_type;
    use std::path::Path;
    use std::sync::Arc;

    /// A file with these times of this type and outputs.
    fn write(path: &Path, kind: &str, t: &[i64], y: &[f64]) {
        let schema = format!("message m {{ required int64 t{kind}; required double y; }}");
        let schema = Arc::new(parse_message_type(&schema).unwrap());
        let file = std::fs::File::create(path).unwrap();
        let mut writer = SerializedFileWriter::new(file, schema, Arc::default()).unwrap();
        let mut group = writer.next_row_group().unwrap();
        column::<Int64Type>(&mut group, t);
        column::<DoubleType>(&mut group, y);
        group.close().unwrap();
        writer.close().unwrap();
    }

    fn column<T: DataType>(group: &mut SerializedRowGroupWriter<'_, std::fs::File>, all: &[T::T]) {
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<T>().write_batch(all, None, None).unwrap();
        column.close().unwrap();
    }

    fn read(kind: &str, t: &[i64], y: &[f64]) -> Result<Record, RecordError> {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("r.parquet");
        write(&path, kind, t, y);
        Record::read(&path)
    }

    #[test]
    fn times_are_seconds_whatever_their_type() {
        let begin = 1_711_843_190;
        for (kind, per_second) in [
            (" (TIMESTAMP(MILLIS,true))", 1000),
            (" (TIMESTAMP(MICROS,false))", 1_000_000),
            (" (TIMESTAMP(NANOS,true))", 1_000_000_000),
            (" (TIMESTAMP(NANOS,false))", 1_000_000_000),
            (" (TIMESTAMP_MILLIS)", 1000),
        ] {
            let t: Vec<i64> = (0..4)
                .map(|k| begin * per_second + k * per_second / 2)
                .collect();
            let record = read(kind, &t, &[1.0, 2.0, 3.0, 1e-300]).unwrap();
            assert_eq!(record.drive().dt(), 0.5, "{kind}");
            assert_eq!(record.outputs()[[3, 0]], 1e-300);
        }
        let noon = 12 * 3600 * 1_000_000_000;
        let clock = read(" (TIME(NANOS,true))", &[noon, noon + 250], &[1.0, 2.0]);
        assert_eq!(clock.unwrap().drive().dt(), 250e-9);
        assert_eq!(read("", &[0, 3], &[1.0, 2.0]).unwrap().drive().dt(), 3.0);
    }

    #[test]
    fn cells_are_quoted_in_few_digits() {
        let error = read("", &[0, 1], &[1.0, 1e300]).unwrap_err().to_string();
        assert!(
            error.contains("row 3, column y: 1e300 is beyond"),
            "{error}"
        );
    }
}
