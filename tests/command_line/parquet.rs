//! Records in Parquet files.

use parquet::data_type::{DoubleType, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;
use truetwin::record::Record;

/// Columns t and y of doubles, and u of integers.
fn write(path: &Path, t: &[f64], y: &[f64]) {
    let schema = "message record { required double t; required int64 u; required double y; }";
    let schema = Arc::new(parse_message_type(schema).unwrap());
    let properties = Arc::new(WriterProperties::builder().build());
    let file = File::create(path).unwrap();
    let mut writer = SerializedFileWriter::new(file, schema, properties).unwrap();
    let mut group = writer.next_row_group().unwrap();
    let mut number = 0;
    while let Some(mut column) = group.next_column().unwrap() {
        match number {
            1 => {
                let u: Vec<i64> = (0..t.len() as i64).collect();
                (column.typed::<Int64Type>().write_batch(&u, None, None)).unwrap()
            }
            number => {
                let values = if number == 0 { t } else { y };
                (column.typed::<DoubleType>().write_batch(values, None, None)).unwrap()
            }
        };
        column.close().unwrap();
        number += 1;
    }
    group.close().unwrap();
    writer.close().unwrap();
}

#[test]
fn a_record_is_read_bit_for_bit_and_checked_as_csv_is() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("r.parquet");
    let y = [1.0 / 3.0, -1e-300, 0.1 + 0.2];
    write(&path, &[0.0, 0.5, 1.0], &y);
    let record = Record::read(&path).unwrap();
    assert_eq!(record.outputs().column(0).to_vec(), y);
    assert_eq!(record.drive().inputs().column(0).to_vec(), [0.0, 1.0, 2.0]);
    let refused = || Record::read(&path).unwrap_err().to_string();
    write(&path, &[0.0, 0.5, 0.4], &y);
    assert!(
        refused().contains("r.parquet, row 4, column t"),
        "{}",
        refused()
    );
    write(&path, &[0.0, 0.5, 1.0], &[1.0, f64::INFINITY, 2.0]);
    assert!(
        refused().contains("row 3, column y: \"inf\""),
        "{}",
        refused()
    );
    write(&path, &[0.0, 0.5, 1.5], &[1.0, f64::NAN, 2.0]);
    let record = Record::read(&path).unwrap();
    assert_eq!((record.missing(), record.drive().step(1)), (1, 1.0));
    std::fs::write(&path, "t,u,y").unwrap();
    assert!(refused().contains("r.parquet"), "{}", refused());
}
