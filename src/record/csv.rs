//! Records and inputs as CSV files; or as Parquet files with the same columns, in a build with the feature `parquet`.
//!
//! A header, then one row a sample: `t` in seconds, uniform to 1e-3 of a step and increasing; inputs `u` or
//! `u1,u2,…`; outputs `y` or `y1,y2,…`. Rows are counted as an editor counts lines: the header is row 1.

use super::measured::column_names;
use super::parquet;
use crate::record::{Drive, DriveError, Record, RecordError, Signal};
use crate::storage::files::{with_remedy, write_new};
use crate::storage::untrusted::{MOST_NUMBERS, Rows, excerpt};
use std::path::{Path, PathBuf};

/// Longest record: a sample a millisecond for half a day.
const MOST_SAMPLES: usize = 50_000_000;
/// Most columns: t and a thousand inputs and outputs each.
const MOST_COLUMNS: usize = 2001;

/// What is wrong with a file: which file, where, which value, and what to do.
///
/// ```
/// use std::path::Path;
/// use truetwin::record::{CsvError, parse_record};
///
/// let error: CsvError = parse_record("t,y\n0,1\n0.1,\n", Path::new("R.csv")).unwrap_err();
/// let message = error.to_string();
/// assert!(message.contains("R.csv") && message.contains("column y"), "{message}");
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CsvError {
    /// The file cannot be read or written.
    #[error("{}: {}", path.display(), with_remedy(error))]
    Io {
        /// File.
        path: PathBuf,
        /// What the system said.
        error: std::io::Error,
    },
    /// The text is no CSV table.
    #[error("{}: {error}; a record is UTF-8 text, each row with as many cells as the header", path.display())]
    Syntax {
        /// File.
        path: PathBuf,
        /// What the parser said.
        error: csv::Error,
    },
    /// The header does not name a record's columns.
    #[error("{}: {problem}", path.display())]
    Header {
        /// File.
        path: PathBuf,
        /// What is wrong, and the remedy.
        problem: String,
    },
    /// A cell that is no finite number.
    #[error(
        "{}, row {row}, column {column}: \"{value}\" is no finite number; correct or remove the row",
        path.display()
    )]
    Cell {
        /// File.
        path: PathBuf,
        /// Line of the file, the header being 1.
        row: usize,
        /// Column name.
        column: String,
        /// What stands there.
        value: String,
    },
    /// Time that is not uniform or not increasing.
    #[error(
        "{}, row {row}, column t: {value} s where {expected} s was expected; time must increase by the same step to 1e-3 of it: resample the record",
        path.display()
    )]
    Time {
        /// File.
        path: PathBuf,
        /// Line of the file, the header being 1.
        row: usize,
        /// Time found.
        value: f64,
        /// Time expected.
        expected: f64,
    },
    /// More than any record has.
    #[error("{}: {problem}; cut the record into shorter ones, or resample it", path.display())]
    Size {
        /// File.
        path: PathBuf,
        /// The limit that it exceeds.
        problem: String,
    },
    /// Too few rows to know the step.
    #[error("{}: {rows} rows of data; at least 2 are needed to know the step", path.display())]
    Short {
        /// File.
        path: PathBuf,
        /// Rows of data.
        rows: usize,
    },
    /// The columns do not make a record.
    #[error("{}: {error}", path.display())]
    Record {
        /// File.
        path: PathBuf,
        /// Why.
        error: RecordError,
    },
}

/// Reads a measured record.
///
/// ```
/// use truetwin::record::{Drive, Record, Signal, read_record, write_record};
///
/// let record = Record::new(Drive::new(0.5, Signal::ones((3, 1)))?, Signal::zeros((3, 1)))?;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("R.csv");
/// write_record(&path, &record)?;
/// assert_eq!(read_record(&path)?, record);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_record(path: &Path) -> Result<Record, CsvError> {
    Table::read(path)?.record(path)
}

/// Reads time and inputs to simulate with; outputs, if the file is a record, are ignored.
///
/// ```
/// use truetwin::record::{Drive, Record, Signal, read_drive, write_record};
///
/// let record = Record::new(Drive::new(0.5, Signal::ones((3, 1)))?, Signal::zeros((3, 1)))?;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("R.csv");
/// write_record(&path, &record)?;
/// assert_eq!(read_drive(&path)?, *record.drive());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_drive(path: &Path) -> Result<Drive, CsvError> {
    let table = Table::read(path)?;
    Drive::new(table.dt, table.inputs).map_err(|error: DriveError| CsvError::Record {
        path: path.into(),
        error: error.into(),
    })
}

/// Parses the text of a record that stands in the program itself; `path` is for messages.
///
/// ```
/// use std::path::Path;
/// use truetwin::record::parse_record;
///
/// let record = parse_record("t,u,y\n0,1,0\n0.5,1,0.2\n1,0,0.3\n", Path::new("embedded.csv"))?;
/// assert_eq!((record.samples(), record.drive().dt()), (3, 0.5));
/// # Ok::<(), truetwin::record::CsvError>(())
/// ```
pub fn parse_record(text: &str, path: &Path) -> Result<Record, CsvError> {
    Table::parse(text.as_bytes(), path)?.record(path)
}

/// The text of an input file, as [`read_drive`] reads it.
///
/// ```
/// use truetwin::record::{Drive, Signal, drive_csv_text};
///
/// let drive = Drive::new(0.5, Signal::ones((2, 1)))?;
/// assert_eq!(drive_csv_text(&drive), "t,u\n0,1\n0.5,1\n");
/// # Ok::<(), truetwin::record::DriveError>(())
/// ```
pub fn drive_csv_text(drive: &Drive) -> String {
    csv_text(drive, &Signal::zeros((drive.samples(), 0)))
}

/// The text of a record file; reading it gives the same bits of u and y.
///
/// ```
/// use truetwin::record::{Drive, Record, Signal, record_csv_text};
///
/// let record = Record::new(Drive::new(0.5, Signal::ones((3, 1)))?, Signal::zeros((3, 1)))?;
/// assert_eq!(record_csv_text(&record), "t,u,y\n0,1,0\n0.5,1,0\n1,1,0\n");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn record_csv_text(record: &Record) -> String {
    csv_text(record.drive(), record.outputs())
}

fn csv_text(drive: &Drive, outputs: &Signal) -> String {
    let mut header = vec!["t".to_owned()];
    header.extend(column_names("u", drive.inputs().ncols()));
    header.extend(column_names("y", outputs.ncols()));
    let mut text = header.join(",");
    text.push('\n');
    for k in 0..drive.samples() {
        text.push_str(&rounded_time(drive.time(k), drive.dt()).to_string());
        for value in drive.input(k).iter().chain(outputs.row(k)) {
            text.push_str(&format!(",{value}"));
        }
        text.push('\n');
    }
    text
}

/// Writes a record to a new file, which appears whole or not at all.
///
/// ```
/// use truetwin::record::{Drive, Record, Signal, write_record};
///
/// let record = Record::new(Drive::new(0.5, Signal::ones((3, 1)))?, Signal::zeros((3, 1)))?;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("R.csv");
/// write_record(&path, &record)?;
/// assert!(write_record(&path, &record).is_err()); // nothing is overwritten
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_record(path: &Path, record: &Record) -> Result<(), CsvError> {
    write_new(path, record_csv_text(record).as_bytes()).map_err(|error| CsvError::Io {
        path: path.into(),
        error,
    })
}

/// Time to a billionth of the step, so that 3·0.1 is written as 0.3.
fn rounded_time(t: f64, dt: f64) -> f64 {
    let digits = 10f64.powi(9 - dt.log10().floor() as i32);
    let rounded = (t * digits).round() / digits;
    if rounded.is_finite() { rounded } else { t }
}

/// The numbers of a file.
struct Table {
    dt: f64,
    inputs: Signal,
    outputs: Signal,
}

impl Table {
    fn read(path: &Path) -> Result<Self, CsvError> {
        if path.extension().is_some_and(|e| e == "parquet") {
            return parquet::with_rows(path, |rows| Self::parse(rows, path));
        }
        let file = std::fs::File::open(path).map_err(|error| CsvError::Io {
            path: path.into(),
            error,
        })?;
        Self::parse(file, path)
    }

    /// The table as a record, which needs outputs.
    fn record(self, path: &Path) -> Result<Record, CsvError> {
        if self.outputs.ncols() == 0 {
            return Err(CsvError::Header {
                path: path.into(),
                problem: "no output column; a record needs y, or y1,y2,…".into(),
            });
        }
        let record = |error| CsvError::Record {
            path: path.into(),
            error,
        };
        let drive = Drive::new(self.dt, self.inputs).map_err(|e| record(e.into()))?;
        Record::new(drive, self.outputs).map_err(record)
    }

    fn parse(text: impl std::io::Read, path: &Path) -> Result<Self, CsvError> {
        let mut reader = Rows::new(text);
        let header = reader.header().map_err(|e| csv_error(path, e))?;
        let large = |problem: String| CsvError::Size {
            path: path.into(),
            problem,
        };
        if header.len() > MOST_COLUMNS {
            let given = header.len();
            return Err(large(format!(
                "{given} columns, at most {MOST_COLUMNS} are read"
            )));
        }
        let (inputs, outputs) = channels(&header).map_err(|problem| CsvError::Header {
            path: path.into(),
            problem,
        })?;
        let columns = 1 + inputs + outputs;
        // Where column j of the file goes in a row ordered t, u1, u2, …, y1, y2, ….
        let places: Vec<usize> = header.iter().map(|name| place(name, inputs)).collect();
        // Numbers alone are kept, and each once: a record may fill half of the memory.
        let (mut t, mut u, mut y) = (Vec::new(), Vec::new(), Vec::new());
        let mut row = vec![0.0; columns];
        let mut cells = csv::StringRecord::new();
        while reader.read(&mut cells).map_err(|e| csv_error(path, e))? {
            if t.len() == MOST_SAMPLES {
                return Err(large(format!("more than {MOST_SAMPLES} samples")));
            }
            if (t.len() + 1) * columns > MOST_NUMBERS {
                return Err(large(format!("more than {MOST_NUMBERS} numbers")));
            }
            for ((cell, &place), name) in cells.iter().zip(&places).zip(&header) {
                let number = cell.parse::<f64>().ok().filter(|v| v.is_finite());
                row[place] = number.ok_or_else(|| CsvError::Cell {
                    path: path.into(),
                    row: cells.position().map_or(t.len() + 2, |p| p.line() as usize),
                    column: name.into(),
                    value: excerpt(cell),
                })?;
            }
            t.push(row[0]);
            u.extend_from_slice(&row[1..=inputs]);
            y.extend_from_slice(&row[1 + inputs..]);
        }
        let rows = t.len();
        if rows < 2 {
            return Err(CsvError::Short {
                path: path.into(),
                rows,
            });
        }
        let dt = uniform_step(path, t)?;
        let signal = |width: usize, values: Vec<f64>| {
            Signal::from_shape_vec((rows, width), values).map_err(|error| CsvError::Header {
                path: path.into(),
                problem: error.to_string(),
            })
        };
        Ok(Self {
            dt,
            inputs: signal(inputs, u)?,
            outputs: signal(outputs, y)?,
        })
    }
}

fn csv_error(path: &Path, error: csv::Error) -> CsvError {
    let path = path.to_path_buf();
    match error.into_kind() {
        csv::ErrorKind::Io(error) => CsvError::Io { path, error },
        kind => CsvError::Syntax {
            path,
            error: kind_error(kind),
        },
    }
}

/// The parser's error again, from its kind.
fn kind_error(kind: csv::ErrorKind) -> csv::Error {
    csv::Error::from(std::io::Error::other(match kind {
        csv::ErrorKind::UnequalLengths {
            pos,
            expected_len,
            len,
        } => format!(
            "row {} has {len} cells, the header has {expected_len}",
            pos.map_or(0, |p| p.line())
        ),
        csv::ErrorKind::Utf8 { pos, err } => {
            format!("row {}: {err}", pos.map_or(0, |p| p.line()))
        }
        other => format!("{other:?}"),
    }))
}

/// Number of inputs and outputs that a header names; each of t, u…, y… once and without gaps.
fn channels(header: &csv::StringRecord) -> Result<(usize, usize), String> {
    let count = |letter: char| header.iter().filter(|n| n.starts_with(letter)).count();
    let (inputs, outputs) = (count('u'), count('y'));
    let mut expected = vec!["t".to_owned()];
    expected.extend(column_names("u", inputs));
    expected.extend(column_names("y", outputs));
    let known = |name: &str| {
        expected.iter().any(|e| e == name)
            || [("u", inputs), ("y", outputs)]
                .iter()
                .any(|(l, n)| *n == 1 && name == format!("{l}1"))
    };
    if let Some(name) = header.iter().find(|name| !known(name)) {
        return Err(format!(
            "column \"{}\" is not part of a record; name the columns t, u or u1,u2,…, y or y1,y2,… and remove others",
            excerpt(name)
        ));
    }
    if header.iter().all(str::is_empty) {
        return Err("the file is empty; a record needs a header t,u,y and rows".into());
    }
    if header.len() != expected.len() || !header.iter().any(|name| name == "t") {
        return Err(format!(
            "columns {} are not {}; t and each channel must stand there once",
            excerpt(&header.iter().collect::<Vec<_>>().join(",")),
            excerpt(&expected.join(","))
        ));
    }
    let mut names: Vec<_> = header.iter().collect();
    names.sort_unstable();
    names.dedup();
    if names.len() != header.len() {
        return Err("a column stands there twice; give each its own name".into());
    }
    Ok((inputs, outputs))
}

/// Where a column goes: t first, then inputs, then outputs.
fn place(name: &str, inputs: usize) -> usize {
    let number = name[1..].parse::<usize>().unwrap_or(1);
    match name.as_bytes()[0] {
        b'u' => number,
        b'y' => inputs + number,
        _ => 0,
    }
}

/// The common step of a time column.
fn uniform_step(path: &Path, t: Vec<f64>) -> Result<f64, CsvError> {
    let span = t[t.len() - 1] - t[0];
    let dt = span / (t.len() - 1) as f64;
    let off = |k: usize, expected: f64| CsvError::Time {
        path: path.into(),
        row: k + 2,
        value: t[k],
        expected,
    };
    if let Some(k) = (1..t.len()).find(|&k| t[k] <= t[k - 1]) {
        let step = if k > 1 { t[1] - t[0] } else { dt.abs() };
        return Err(off(k, t[k - 1] + step));
    }
    // A single gap shifts the mean step: name the row where the steps first change, not where they add up.
    let first = t[1] - t[0];
    if let Some(k) = (1..t.len()).find(|&k| (t[k] - t[0] - k as f64 * dt).abs() > 1e-3 * dt) {
        let jump = (1..t.len()).find(|&k| (t[k] - t[k - 1] - first).abs() > 1e-3 * first);
        return Err(jump.map_or_else(
            || off(k, t[0] + k as f64 * dt),
            |k| off(k, t[k - 1] + first),
        ));
    }
    Ok(dt)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Record, CsvError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.csv");
        std::fs::write(&path, text).unwrap();
        read_record(&path)
    }

    fn message(text: &str) -> String {
        read(text).unwrap_err().to_string()
    }

    #[test]
    fn columns_come_in_any_order() {
        let record = read("y2,t,u,y1\n20,0,1,10\n21,0.5,2,11\n22,1.0,3,12\n").unwrap();
        assert_eq!(record.drive().dt(), 0.5);
        assert_eq!(record.drive().input(2), [3.0]);
        assert_eq!(record.outputs().row(1).to_vec(), [11.0, 21.0]);
    }

    #[test]
    fn cells_are_named_by_row_and_column() {
        for bad in ["NaN", "abc", "", "inf"] {
            let text = message(&format!("t,u,y\n0,1,2\n1,1,{bad}\n2,1,2\n"));
            assert!(text.contains("row 3, column y"), "{text}");
            assert!(text.contains(&format!("\"{bad}\"")), "{text}");
        }
    }

    #[test]
    fn headers_are_checked() {
        assert!(message("t,u,y,temperature\n0,1,2,3\n").contains("\"temperature\""));
        assert!(message("t,u\n0,1\n1,1\n").contains("no output"));
        assert!(message("u,y\n0,1\n1,1\n").contains("t"));
        assert!(message("t,y1,y3\n0,1,1\n1,1,1\n").contains("\"y3\""));
        assert!(message("t,y1,y1\n0,1,1\n1,1,1\n").contains("twice"));
        assert!(message("t,y\n0,1\n1\n2,2\n").contains("row 3"));
        assert!(message("t,y\n0,1\n").contains("1 rows"));
    }

    #[test]
    fn time_must_increase_uniformly() {
        assert!(message("t,y\n0,1\n1,1\n0.5,1\n").contains("row 4, column t"));
        assert!(
            message("t,y\n0,1\n1,1\n2,1\n4,1\n5,1\n").contains("row 5, column t: 4 s where 3 s")
        );
        assert!(
            read("t,y\n0,1\n1.0001,1\n2,1\n").is_ok(),
            "1e-4 of a step is within tolerance"
        );
    }

    #[test]
    fn a_record_survives_the_file() {
        let inputs = Signal::from_shape_fn((4, 2), |(k, j)| (k as f64 + 0.1) / (j as f64 + 3.0));
        let drive = Drive::new(0.1, inputs).unwrap();
        let outputs = Signal::from_shape_fn((4, 1), |(k, _)| (k as f64).sin() * 1e-7);
        let record = Record::new(drive, outputs).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.csv");
        write_record(&path, &record).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(
            text.starts_with("t,u1,u2,y\n0,") && text.contains("\n0.3,"),
            "{text}"
        );
        let back = read_record(&path).unwrap();
        assert_eq!(back.outputs(), record.outputs());
        assert_eq!(back.drive().inputs(), record.drive().inputs());
    }

    #[test]
    fn inputs_survive_the_file_and_so_do_instants_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("u.csv");
        let inputs = Signal::from_shape_fn((4, 2), |(k, j)| k as f64 / (j as f64 + 3.0));
        for (drive, header) in [
            (Drive::new(0.1, inputs).unwrap(), "t,u1,u2\n"),
            (Drive::new(0.1, Signal::ones((3, 1))).unwrap(), "t,u\n"),
            (Drive::autonomous(0.5, 3).unwrap(), "t\n0\n0.5\n1\n"),
        ] {
            let text = drive_csv_text(&drive);
            assert!(text.starts_with(header), "{text}");
            std::fs::write(&path, text).unwrap();
            let back = read_drive(&path).unwrap();
            assert_eq!(back.inputs(), drive.inputs());
            assert!((back.dt() - drive.dt()).abs() < 1e-12);
        }
    }
}
