use crate::record::Record;
use parquet::data_type::{
    BoolType, DataType, DoubleType, FixedLenByteArrayType, Int32Type, Int64Type, Int96, Int96Type,
};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use std::fs::File;
use std::sync::Arc;

/// Reads a file with a column that is declared so, and one of doubles.
fn read<T: DataType>(
    (declared, cells): (&str, &[T::T]),
    (other, values): (&str, &[f64]),
) -> Result<Record, String> {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("r.parquet");
    let schema = format!("message r {{ required {declared}; required double {other}; }}");
    let schema = Arc::new(parse_message_type(&schema).unwrap());
    let file = File::create(&path).unwrap();
    let mut writer = SerializedFileWriter::new(file, schema, Arc::default()).unwrap();
    let mut group = writer.next_row_group().unwrap();
    let mut column = group.next_column().unwrap().unwrap();
    (column.typed::<T>().write_batch(cells, None, None)).unwrap();
    column.close().unwrap();
    let mut column = group.next_column().unwrap().unwrap();
    (column.typed::<DoubleType>().write_batch(values, None, None)).unwrap();
    column.close().unwrap();
    group.close().unwrap();
    writer.close().unwrap();
    Record::read(&path).map_err(|error| error.to_string())
}

const THREE: &[f64] = &[0.0, 1.0, 3.0];

#[test]
fn types_of_times_are_seconds_from_the_first_row() {
    let check = |declared: &str, read: Result<Record, String>, expected: [f64; 3]| {
        let record = read.unwrap();
        let drive = record.drive();
        let times = [0, 1, 2].map(|k| drive.own_time(k));
        assert_eq!(times, expected, "{declared}");
        assert!(drive.rows().has_stamps(), "{declared}");
    };
    let begin = 1_711_843_190_i64;
    for (declared, first, rate) in [
        (
            "int64 t (TIMESTAMP(NANOS,true))",
            begin * 1_000_000_000,
            1e9,
        ),
        (
            "int64 t (TIMESTAMP(NANOS,false))",
            begin * -1_000_000_000,
            1e9,
        ),
        ("int64 t (TIMESTAMP(MICROS,false))", begin * 1_000_000, 1e6),
        ("int64 t (TIMESTAMP(MILLIS,true))", begin * 1000, 1e3),
        ("int64 t (TIMESTAMP_MILLIS)", begin * 1000, 1e3),
        ("int64 t (TIME(NANOS,false))", 86_300_000_000_007, 1e9),
        ("int64 t (TIME(MICROS,true))", 7, 1e6),
    ] {
        let cells = [0, 1, 7].map(|count| first + count);
        let read = read::<Int64Type>((declared, &cells), ("y", THREE));
        check(declared, read, [0.0, 1.0 / rate, 7.0 / rate]);
    }
    for (declared, expected) in [
        ("int32 t (TIME(MILLIS,true))", [0.0, 0.001, 0.007]),
        ("int32 t (DATE)", [0.0, 86_400.0, 604_800.0]),
    ] {
        let read = read::<Int32Type>((declared, &[19_800, 19_801, 19_807]), ("y", THREE));
        check(declared, read, expected);
    }
    let midnight = (0..3).map(|k: u32| {
        let mut time = Int96::new();
        time.set_data(k, 0, 2_460_401 + k / 2);
        time
    });
    let cells: Vec<Int96> = midnight.collect();
    let read = read::<Int96Type>(("int96 t", &cells), ("y", THREE));
    check("int96", read, [0.0, 1e-9, 86_400.000_000_002]);
}

#[test]
fn cells_and_columns_that_are_no_numbers_are_told_as_the_file_has_them() {
    let told = |read: Result<Record, String>, expected: &str| {
        let error = read.unwrap_err();
        assert!(error.contains(&format!("r.parquet, {expected}")), "{error}");
    };
    let counts = [1_711_843_190_000_000_000, 2, 3];
    for (declared, kind) in [
        ("y (TIMESTAMP(NANOS,true))", "timestamp[ns]"),
        ("y (TIMESTAMP(MILLIS,true))", "timestamp[ms]"),
        ("y (TIME(MICROS,true))", "time64[us]"),
    ] {
        let declared = format!("int64 {declared}");
        let read = read::<Int64Type>((&declared, &counts), ("t", THREE));
        let expected = format!("column y: its type {kind} holds no numbers; save it as");
        told(read, &expected);
    }
    let read_bool = read::<BoolType>(("boolean y", &[true; 3]), ("t", THREE));
    told(read_bool, "column y: its type bool holds");
    let spans = vec![vec![0_u8; 12].into(); 3];
    let declared = "fixed_len_byte_array(12) y (INTERVAL)";
    let spans = read::<FixedLenByteArrayType>((declared, &spans), ("t", THREE));
    told(spans, "column y: its type interval holds");
    let late = ("int64 t (TIMESTAMP(MILLIS,true))", &[0, i64::MAX, 1][..]);
    let expected = "row 2, column t: the time is beyond 0000-01-01 to 9999-12-30; correct";
    told(read::<Int64Type>(late, ("y", THREE)), expected);
    let large = |value| read::<Int32Type>(("int32 t", &[0, 1, 2]), ("y", &[value, 1.0, 2.0]));
    told(large(1e300), "row 1, column y: 1e300 is beyond");
    told(
        large(-1.234_567_890_12e150),
        "row 1, column y: -1.2345679e150 is beyond",
    );
    told(
        large(f64::INFINITY),
        "row 1, column y: \"inf\" is no finite number",
    );
    let decimals = ("int64 y (DECIMAL(18,2))", &[150, -5, 3][..]);
    let record = read::<Int64Type>(decimals, ("t", THREE)).unwrap();
    assert_eq!(record.outputs().column(0).to_vec(), [1.5, -0.05, 0.03]);
}

/// Data frames are written so: each column may lack values, and rows come in groups.
#[test]
fn columns_may_lack_values() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("r.parquet");
    let schema = "message r { optional int64 t (TIMESTAMP(MILLIS,true)); optional double y; }";
    let schema = Arc::new(parse_message_type(schema).unwrap());
    let write = |lacks_time: bool| {
        let file = File::create(&path).unwrap();
        let mut writer = SerializedFileWriter::new(file, schema.clone(), Arc::default()).unwrap();
        for begin in [0, 1500] {
            let mut group = writer.next_row_group().unwrap();
            let mut column = group.next_column().unwrap().unwrap();
            let has = |k: &i64| !(lacks_time && *k == 1700);
            let times: Vec<i64> = (begin..begin + 1500).filter(has).collect();
            let levels: Vec<i16> = (begin..begin + 1500).map(|k| has(&k).into()).collect();
            let typed = column.typed::<Int64Type>();
            typed.write_batch(&times, Some(&levels), None).unwrap();
            column.close().unwrap();
            let mut column = group.next_column().unwrap().unwrap();
            let has = |k: &i64| k % 7 != 0;
            let values = (begin..begin + 1500).filter(has).map(|k| k as f64);
            let levels: Vec<i16> = (begin..begin + 1500).map(|k| has(&k).into()).collect();
            let values: Vec<f64> = values.collect();
            let typed = column.typed::<DoubleType>();
            typed.write_batch(&values, Some(&levels), None).unwrap();
            column.close().unwrap();
            group.close().unwrap();
        }
        writer.close().unwrap();
        Record::read(&path).map_err(|error| error.to_string())
    };
    let record = write(false).unwrap();
    let values = record.outputs().column(0).to_vec();
    assert_eq!((values.len(), record.drive().dt()), (3000, 0.001));
    for (k, value) in values.iter().enumerate() {
        assert!(*value == k as f64 || k % 7 == 0 && value.is_nan(), "{k}");
    }
    let error = write(true).unwrap_err();
    assert!(error.contains("row 1701, column t: no value;"), "{error}");
}
