//! Records in Parquet files: the same columns as in CSV, so the same rules and messages; a header stands for row 1. Times are time stamps.

#[cfg(feature = "parquet")]
use super::text::cell;
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
    use crate::storage::untrusted::excerpt;
    use parquet::file::reader::{FileReader, SerializedFileReader};

    let unread = |error| RecordError::io(path, error);
    let file = open(path).map_err(unread)?;
    let wrong = |error: parquet::errors::ParquetError| {
        let remedy = "a record has columns of numbers, snappy or not compressed";
        RecordError::file(path, format!("{error}; {remedy}"))
    };
    let no_file = |_| RecordError::file(path, "no whole Parquet file; write it again");
    let reader = SerializedFileReader::new(file.try_clone().map_err(unread)?).map_err(no_file)?;
    let schema = reader.metadata().file_metadata().schema_descr();
    let (mut names, mut units) = (vec![], vec![]);
    let durations = times::durations(reader.metadata().file_metadata());
    for column in schema.columns() {
        let name = &column.path().parts()[0];
        // One that holds lists or tables has a part for each of their entries; a row has one cell.
        let own = cell(name);
        if column.path().parts().len() > 1 && names.last() == Some(&own) {
            continue;
        }
        let unit = match durations.get(name) {
            Some(unit) => Ok(Some(*unit)),
            None => times::unit(column),
        };
        let wrong =
            |problem| RecordError::file(path, format!("column {} {problem}", excerpt(name)));
        units.push(unit.map_err(wrong)?);
        names.push(own);
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
    /// Meaning of the counts of columns of times.
    units: Vec<Option<times::Unit>>,
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
fn line(row: &parquet::record::Row, units: &[Option<times::Unit>]) -> String {
    use parquet::record::Field;

    let written = |((_, field), unit): ((&String, &Field), &Option<times::Unit>)| {
        let time = unit.and_then(|unit| unit.cell(field));
        time.unwrap_or_else(|| match field {
            // With an exponent where it is very large or small.
            Field::Double(value) => format!("{value:?}"),
            Field::Float(value) => format!("{:?}", f64::from(*value)),
            Field::Null => String::new(),
            // Anything else that is no number is named by the checks of a cell.
            Field::Str(text) => cell(text).into_owned(),
            other => cell(&other.to_string()).into_owned(),
        })
    };
    let cells: Vec<String> = row.get_column_iter().zip(units).map(written).collect();
    cells.join(",") + "\n"
}

/// Columns of times.
#[cfg(feature = "parquet")]
mod times {
    use crate::setting::number;
    use jiff::Timestamp;
    use parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type};
    use parquet::file::metadata::FileMetaData;
    use parquet::record::Field;
    use parquet::schema::types::ColumnDescriptor;
    use serde_json::Value;
    use std::collections::HashMap;
    use std::time::Duration;

    /// Meaning of a count, in nanoseconds.
    #[derive(Debug, Clone, Copy)]
    pub(super) enum Unit {
        /// A time of the calendar, or of a day.
        Stamp(i128),
        /// A duration.
        Duration(f64),
    }

    /// Returns the columns of durations that pandas has written; the types of Parquet have none.
    pub(super) fn durations(file: &FileMetaData) -> HashMap<String, Unit> {
        let told = (file.key_value_metadata().into_iter().flatten())
            .find(|entry| entry.key == "pandas")
            .and_then(|entry| serde_json::from_str::<Value>(entry.value.as_deref()?).ok());
        let columns = told.as_ref().and_then(|told| told["columns"].as_array());
        let duration = |column: &Value| {
            let nanoseconds = match column["numpy_type"].as_str()? {
                "timedelta64[s]" => 1e9,
                "timedelta64[ms]" => 1e6,
                "timedelta64[us]" => 1e3,
                "timedelta64[ns]" => 1.0,
                _ => return None,
            };
            let name = column["field_name"].as_str()?;
            Some((name.to_owned(), Unit::Duration(nanoseconds)))
        };
        columns.into_iter().flatten().filter_map(duration).collect()
    }

    /// Returns what a count stands for; `None` of a column that holds no times. Those of INT96 lose what is below a millisecond, and are refused.
    pub(super) fn unit(column: &ColumnDescriptor) -> Result<Option<Unit>, String> {
        let unit = match (column.logical_type_ref(), column.converted_type()) {
            _ if column.physical_type() == Type::INT96 => {
                let remedy = "save it as a timestamp of milliseconds, microseconds or nanoseconds";
                return Err(format!("is of the old type INT96; {remedy}"));
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
        Ok(Some(Unit::Stamp(unit.as_nanos().cast_signed())))
    }

    fn of_unit(unit: &TimeUnit) -> Duration {
        match unit {
            TimeUnit::MILLIS => Duration::from_millis(1),
            TimeUnit::MICROS => Duration::from_micros(1),
            TimeUnit::NANOS => Duration::from_nanos(1),
        }
    }

    impl Unit {
        /// Returns a time as text that is exact, of a day or of the first of 1970, and a duration in seconds; `None` of a cell that is no count.
        pub fn cell(self, field: &Field) -> Option<String> {
            let count = match *field {
                Field::Long(n)
                | Field::TimestampMillis(n)
                | Field::TimestampMicros(n)
                | Field::TimeMicros(n) => n,
                Field::Int(n) | Field::TimeMillis(n) | Field::Date(n) => n.into(),
                _ => return None,
            };
            match self {
                Self::Duration(unit) => Some(format!("{:?}", count as f64 * unit / 1e9)),
                Self::Stamp(unit) => {
                    let stamp = Timestamp::from_nanosecond(i128::from(count) * unit);
                    let beyond = |_| format!("{} beyond the calendar", number(count as f64));
                    Some(stamp.map_or_else(beyond, |stamp| stamp.to_string()))
                }
            }
        }
    }
}

#[cfg(all(test, feature = "parquet"))]
mod tests {
    use crate::record::{Record, RecordError};
    use parquet::data_type::{DataType, DoubleType, Int64Type};
    use parquet::file::metadata::KeyValue;
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
    use parquet::schema::parser::parse_message_type;
    use std::path::Path;
    use std::sync::Arc;

    /// A file with these times of this type and outputs, and what pandas tells of it.
    fn write(path: &Path, kind: &str, t: &[i64], y: &[f64], pandas: Option<&str>) {
        let schema = format!("message m {{ required int64 t{kind}; required double y; }}");
        let schema = Arc::new(parse_message_type(&schema).unwrap());
        let file = std::fs::File::create(path).unwrap();
        let told = pandas.map(|text| vec![KeyValue::new("pandas".into(), Some(text.into()))]);
        let properties = WriterProperties::builder().set_key_value_metadata(told);
        let properties = Arc::new(properties.build());
        let mut writer = SerializedFileWriter::new(file, schema, properties).unwrap();
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
        write(&path, kind, t, y, None);
        Record::read(&path)
    }

    #[test]
    fn durations_of_pandas_are_seconds() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("r.parquet");
        let told = r#"{"columns": [{"name": "t", "field_name": "t", "numpy_type": "timedelta64[ms]"}, {"name": "y"}]}"#;
        write(&path, "", &[0, 250, 500], &[1.0, 2.0, 3.0], Some(told));
        assert_eq!(Record::read(&path).unwrap().drive().dt(), 0.25);
    }

    #[test]
    fn cells_that_are_no_number_are_told_by_column_and_text() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("r.parquet");
        for (kind, cell) in [
            (
                "required group y (LIST) { repeated group list { required double element; } }",
                "[0.5]",
            ),
            (
                "required group y { required double a; required double b; }",
                "{a: 0.5, b: 0.5}",
            ),
        ] {
            let schema = format!("message m {{ required int64 t; {kind} }}");
            let schema = Arc::new(parse_message_type(&schema).unwrap());
            let file = std::fs::File::create(&path).unwrap();
            let mut writer =
                SerializedFileWriter::new(file, schema.clone(), Arc::default()).unwrap();
            let mut group = writer.next_row_group().unwrap();
            column::<Int64Type>(&mut group, &[0, 1]);
            for _ in 1..schema.get_fields().len() + usize::from(cell.contains('b')) {
                let mut column = group.next_column().unwrap().unwrap();
                let levels = cell.starts_with('[').then_some(&[1, 1][..]);
                let begins = cell.starts_with('[').then_some(&[0, 0][..]);
                (column
                    .typed::<DoubleType>()
                    .write_batch(&[0.5, 0.5], levels, begins))
                .unwrap();
                column.close().unwrap();
            }
            group.close().unwrap();
            writer.close().unwrap();
            let error = Record::read(&path).unwrap_err().to_string();
            let expected = format!("row 2, column y: \"{cell}\" is no finite number");
            assert!(error.contains(&expected), "{error}");
        }
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
