//! Records and inputs as CSV files; or as Parquet files with the same columns, in a build with the feature `parquet`.
//!
//! A header, then one row a sample: `t` in seconds or as time stamps, increasing; inputs `u` or `u1,u2,…`; outputs `y` or `y1,y2,…`; other
//! names by [`Columns`]. Columns are separated by commas, semicolons or tabs. An output that was not measured is an empty cell, `nan` or
//! `NA`; its column may be left out where the twin is known. Steps that are the same to 1e-3 count as one. Rows of one time are replicates. Rows are counted as an editor counts lines: the header is row 1.

use super::channels::{columns, header};
use super::columns::{Columns, Wanted};
use super::parquet;
use super::table::Table;
use super::text::{Text, cell};
use crate::record::{Drive, Record, RecordError, Signal, Signals};
use crate::storage::files::write_new;
use crate::storage::reading::Reading;
use std::path::Path;

impl Record {
    /// Reads a measured record: CSV, or Parquet in a build with that feature.
    ///
    /// ```
    /// use truetwin::record::{Drive, Record, Signal};
    ///
    /// let record = Record::new(Drive::new(0.5, Signal::ones((3, 1)))?, Signal::zeros((3, 1)))?;
    /// let folder = tempfile::tempdir()?;
    /// let path = folder.path().join("R.csv");
    /// record.write(&path)?;
    /// assert_eq!(Record::read(&path)?, record);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// File, row and column that cannot be read, and what to do.
    pub fn read(path: &Path) -> Result<Self, RecordError> {
        RecordReader::default().record(path)
    }
}

impl Drive {
    /// Reads time and inputs to simulate with; a file with outputs is refused.
    ///
    /// # Errors
    ///
    /// As [`Record::read`].
    pub fn read(path: &Path) -> Result<Self, RecordError> {
        RecordReader::default().drive(path)
    }
}

/// Parses the text of a record that stands in the program itself; `path` is for messages.
pub fn parse_record(text: &str, path: &Path) -> Result<Record, RecordError> {
    let text = Text::own(text.as_bytes());
    let wanted = Wanted::Record(&Columns::default(), None);
    Table::parse(text, path, wanted, &mut 0)?.record(path)
}

/// Reads the files of one call: their columns have the same names, and all of them together have a limit.
#[derive(Default)]
pub struct RecordReader {
    columns: Columns,
    signals: Option<Signals>,
    /// Name of the twin whose channels each record must have.
    twin: Option<String>,
    /// Numbers read so far.
    read: usize,
}

impl RecordReader {
    /// Creates a reader of files with these columns, for a twin with these channels.
    pub fn new(columns: Columns, signals: Option<Signals>) -> Self {
        Self {
            columns,
            signals,
            ..Self::default()
        }
    }

    /// Refuses records that do not have the channels of the twin; messages call it by this name.
    #[must_use]
    pub fn for_twin(mut self, name: &str) -> Self {
        self.twin = Some(name.into());
        self
    }

    /// Reads a measured record.
    pub fn record(&mut self, path: &Path) -> Result<Record, RecordError> {
        let columns = self.columns.clone();
        let record = self.channels(path, &columns)?.record(path)?;
        if let Some((twin, signals)) = self.twin.as_ref().zip(self.signals.as_ref()) {
            (record.check_channels(signals)).map_err(|error| error.of_twin(twin).within(path))?;
        }
        Ok(record)
    }

    /// Reads a measured record of which no twin is known, and the names of its columns: time, inputs, outputs. Without names of columns, the
    /// first letters tell which is which; `y0,y1` and `y1,y3` are two outputs each.
    pub(crate) fn named(&mut self, path: &Path) -> Result<(Record, Vec<String>), RecordError> {
        if !self.columns.is_empty() {
            let record = self.record(path)?;
            let (inputs, outputs) = (record.drive().inputs(), record.outputs());
            let names = columns(inputs.ncols(), outputs.ncols());
            return Ok((record, names));
        }
        let table = table(path, Wanted::ByLetter, &mut self.read)?;
        let names = table.names().to_vec();
        Ok((table.record(path)?, names))
    }

    /// Reads time and inputs; columns of outputs are refused.
    pub fn drive(&mut self, path: &Path) -> Result<Drive, RecordError> {
        let columns = self.columns.without_outputs(self.signals.as_ref());
        self.channels(path, &columns)?.drive(path)
    }

    /// Reads time and one input: the column with the first of these names that the file has, or its only column that is no output. Without
    /// names, the time alone.
    pub fn input(&mut self, path: &Path, names: &[&str]) -> Result<Drive, RecordError> {
        table(path, Wanted::Input(names), &mut self.read)?.drive(path)
    }

    fn channels(&mut self, path: &Path, columns: &Columns) -> Result<Table, RecordError> {
        let wanted = Wanted::Record(columns, self.signals.as_ref());
        table(path, wanted, &mut self.read)
    }
}

fn table(path: &Path, wanted: Wanted<'_>, read: &mut usize) -> Result<Table, RecordError> {
    if path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("parquet"))
    {
        return parquet::with_rows(path, |rows| {
            Table::parse(Text::own(rows), path, wanted, read)
        });
    }
    let wrong = |error| RecordError::io(path, error);
    let file = Reading::open(path).map_err(wrong)?;
    let text = Text::open(file).map_err(wrong)?;
    let text = text.map_err(|problem| RecordError::file(path, problem))?;
    Table::parse(text, path, wanted, read)
}

/// The text of an input file for a twin with these channels.
pub(crate) fn drive_csv_text(drive: &Drive, signals: &Signals) -> String {
    let outputs = Signal::zeros((drive.samples(), 0));
    csv_text(&header(signals, false), drive, &outputs)
}

/// The text of a record file; reading it gives the same bits of u and y, and of t where steps vary. A missing output is an empty cell.
pub(crate) fn record_csv_text(record: &Record) -> String {
    let inputs = record.drive().inputs().ncols();
    named_csv_text(record, &columns(inputs, record.outputs().ncols()))
}

/// As [`record_csv_text`], with names of the columns: time, inputs, outputs.
pub(crate) fn named_csv_text(record: &Record, names: &[String]) -> String {
    csv_text(names, record.drive(), record.outputs())
}

fn csv_text(header: &[String], drive: &Drive, outputs: &Signal) -> String {
    let cells: Vec<_> = header.iter().map(|name| cell(name)).collect();
    let mut text = cells.join(",") + "\n";
    for k in 0..drive.samples() {
        text += &drive.own_time(k).to_string();
        for value in drive.input(k).iter().chain(outputs.row(k)) {
            text.push(',');
            if !value.is_nan() {
                text += &value.to_string();
            }
        }
        text.push('\n');
    }
    text
}

impl Record {
    /// Writes a new CSV file, which appears whole or not at all.
    ///
    /// # Errors
    ///
    /// The file exists, or cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), RecordError> {
        let names = columns(self.drive().inputs().ncols(), self.outputs().ncols());
        self.write_named(path, &names)
    }

    /// As [`write`](Self::write), with names of the columns: time, inputs, outputs.
    pub(crate) fn write_named(&self, path: &Path, names: &[String]) -> Result<(), RecordError> {
        let text = named_csv_text(self, names);
        write_new(path, text.as_bytes()).map_err(|error| RecordError::io(path, error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Quantity;
    use crate::storage::untrusted::MOST_NUMBERS;

    fn written(text: &str) -> Result<Record, RecordError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.csv");
        std::fs::write(&path, text).unwrap();
        Record::read(&path)
    }

    /// Rows are counted as an editor does, also that of a header which is none; times are written as equations see them.
    #[test]
    fn a_missing_header_has_its_row() {
        let error = written("# t,u,y\n\n0,1,2\n1,1,2\n")
            .unwrap_err()
            .to_string();
        assert!(error.contains("row 3 holds numbers"), "{error}");
        let (inputs, outputs) = (Signal::zeros((8, 0)), Signal::ones((8, 1)));
        let record = Record::new(Drive::new(0.1, inputs).unwrap(), outputs).unwrap();
        let read = written(&record_csv_text(&record)).unwrap();
        for k in 0..8 {
            let seen = [&record, &read].map(|record| record.drive().own_time(k));
            assert_eq!(seen, [k as f64 / 10.0; 2]);
        }
    }

    fn message(text: &str) -> String {
        written(text).unwrap_err().to_string()
    }

    #[test]
    fn a_limit_holds_for_all_records_together() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.csv");
        std::fs::write(&path, "t,u,y\n0,1,2\n1,1,2\n").unwrap();
        let mut reader = RecordReader {
            read: MOST_NUMBERS - 17,
            ..RecordReader::default()
        };
        for _ in 0..2 {
            reader.record(&path).unwrap();
        }
        let error = reader.record(&path).unwrap_err().to_string();
        assert!(error.contains("in all records; cut"), "{error}");
    }

    #[test]
    fn columns_come_in_any_order() {
        let record = written("y2,t,u,y1\n20,0,1,10\n21,0.5,2,11\n22,1.0,3,12\n").unwrap();
        assert_eq!(record.drive().dt(), 0.5);
        assert_eq!(record.drive().input(2), [3.0]);
        assert_eq!(record.outputs().row(1).to_vec(), [11.0, 21.0]);
    }

    #[test]
    fn cells_are_named_by_row_and_column() {
        for bad in ["abc", "inf", "-", "N/A"] {
            let text = message(&format!("t,u,y\n0,1,2\n1,1,{bad}\n2,1,2\n"));
            assert!(text.contains("row 3, column y"), "{text}");
            assert!(text.contains(&format!("\"{bad}\"")), "{text}");
            assert!(text.contains("leave the cell of an output empty"), "{text}");
        }
        let text = message("t,u,y\n-1.7e308,1,2\n0,1,2\n");
        assert!(text.contains("-1.7e308 is beyond"), "{text}");
        let text = message("t,u,y\ns,V,m\n0,1,2\n1,1,2\n");
        assert!(text.contains(": row 2 has no number; remove it"), "{text}");
        for missing in ["", "nan", "NaN", "NA"] {
            let text = message(&format!("t,u,y\n0,1,2\n1,{missing},2\n2,1,2\n"));
            assert!(text.contains("row 3, column u: no value;"), "{text}");
            let text = message(&format!("t,u,y\n0,1,2\n1,1,2\n{missing},1,2\n"));
            assert!(text.contains("row 4, column t: no value;"), "{text}");
        }
    }

    /// Empty lines count, in whatever a message is about.
    #[test]
    fn rows_are_counted_as_an_editor_counts_lines() {
        for (text, part) in [
            ("t,u,y\n\n0,1,2\n\n\n1,1,a\n", "row 6, column y"),
            (
                "t,u,y\n0,1,2\n\n1,1,2\n\n0.5,1,2\n",
                "row 6, column t: 0.5 s follows",
            ),
            (
                "\nt,u,y\n0,1,2\n\n0,3,2\n1,1,2\n",
                "row 5, column u: input 1",
            ),
            ("t,u,y\r\n\r\n0,1,2\r\n1,1\r\n", "row 4 has 2 cells"),
            ("t;u;y\n0,5;1;2\n\n1.5;1;2\n", "row 4, column t"),
        ] {
            let message = message(text);
            assert!(message.contains(part), "{message}");
        }
        let incomplete = |text| written(text).unwrap().check_complete().unwrap_err();
        let missing = incomplete("t,u,y\n\n0,1,2\n1,1,2\n\n2,1,\n").to_string();
        assert!(missing.starts_with("row 6, column y"), "{missing}");
        let uneven = incomplete("t,y\n0,1\n1,1\n\n2,1\n\n5,1\n").to_string();
        assert!(uneven.starts_with("row 7, column t"), "{uneven}");
        let (plain, spaced) = ("t,y\n0,1\n1,2\n", "t,y\n\n0,1\n1,2\n");
        assert_eq!(written(plain).unwrap(), written(spaced).unwrap());
    }

    #[test]
    fn headers_are_checked() {
        assert!(message("t,u,y,temperature\n0,1,2,3\n").contains("\"temperature\""));
        assert!(message("t,u\n0,1\n1,1\n").contains("no output"));
        assert!(message("u,y\n0,1\n1,1\n").contains("t"));
        assert!(message("t,y1,y3\n0,1,1\n1,1,1\n").contains("\"y3\""));
        assert!(message("t,y1,y1\n0,1,1\n1,1,1\n").contains("twice"));
        assert!(message("t,y\n0,1\n1\n2,2\n").contains("row 3"));
        assert!(message("t,y\n0,1\n").contains("1 row of data"));
    }

    /// Columns have the names of the file; where there are more than channels, numbers are not to blame.
    #[test]
    fn surplus_columns_are_named_as_the_file_has_them() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("r.csv");
        for (header, told) in [
            ("t,u1,u3,y", "2 inputs (u1,u3), the twin has 1 (u)"),
            ("t,u,y1,y3", "2 outputs (y1,y3), the twin has 1 (y)"),
            ("t,u,y,y2", "2 outputs (y,y2), the twin has 1 (y)"),
            ("t,u2,y", "column \"u2\" is out of order"),
        ] {
            let width = header.split(',').count();
            let row = |t: &str| format!("{t}{}\n", ",1".repeat(width - 1));
            std::fs::write(&path, format!("{header}\n{}{}", row("0"), row("1"))).unwrap();
            let mut reader = RecordReader::new(Columns::default(), Some(Signals::default()));
            let error = reader.record(&path).unwrap_err().to_string();
            assert!(error.contains(told), "{header}: {error}");
        }
    }

    #[test]
    fn time_must_increase() {
        for times in ["0.5", "-1"] {
            let text = message(&format!("t,y\n0,1\n1,1\n{times},1\n"));
            assert!(text.contains("row 4, column t"), "{text}");
        }
        let even = written("t,y\n0,1\n1.0001,1\n2,1\n").unwrap();
        assert!(
            even.drive().is_uniform(),
            "1e-4 of a step is within tolerance"
        );
        let tiny = message("t,y\n0,1\n1e-310,1\n2e-310,1\n");
        assert!(tiny.contains("1e-310"), "{tiny}");
        let uneven = written("t,y\n10,1\n11,1\n12,1\n14,1\n15,1\n").unwrap();
        let steps: Vec<f64> = (0..5).map(|k| uneven.drive().step(k)).collect();
        assert_eq!(steps, [1.0, 1.0, 2.0, 1.0, 1.0]);
        assert_eq!((uneven.drive().dt(), uneven.drive().time(3)), (1.0, 4.0));
    }

    /// Rows of one time survive the file; other inputs there are refused by row and column.
    #[test]
    fn replicates_are_readings_of_one_state() {
        let text = "t,u,y\n10,1,1.5\n10,1,1.6\n11,2,1.7\n";
        let record = written(text).unwrap();
        assert_eq!(record.drive().replicates(), 1);
        assert_eq!(record_csv_text(&record), text);
        let text = message("t,u1,u2,y\n0,1,2,3\n0,1,5,3\n1,1,5,3\n");
        assert!(
            text.contains("row 3, column u2: input 2 is 5, and 2 in"),
            "{text}"
        );
    }

    /// A record may lack outputs of the twin if it has another one.
    #[test]
    fn a_sensor_may_be_missing_altogether() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.csv");
        let signals = Signals {
            inputs: vec![Quantity::new("u", "V")],
            outputs: ["upper", "middle", "lower"]
                .map(|name| Quantity::new(name, "m"))
                .into(),
        };
        let read = |columns: &str, text: &str| {
            std::fs::write(&path, text).unwrap();
            let columns = match columns {
                "" => Columns::default(),
                columns => columns.parse().unwrap(),
            };
            let reader = RecordReader::new(columns, Some(signals.clone()));
            reader.for_twin("tanks").record(&path)
        };
        let there = |columns, text| {
            let record = read(columns, text).unwrap();
            [0, 1, 2].map(|j| record.has_output(j))
        };
        assert_eq!(
            there("", "t,u,y1,y3\n0,1,2,3\n1,1,2,3\n"),
            [true, false, true]
        );
        assert_eq!(there("", "t,u,lower\n0,1,2\n1,1,2\n"), [false, false, true]);
        let columns = "upper=A,middle=B,lower=C";
        assert_eq!(
            there(columns, "t,u,C,A\n0,1,2,3\n1,1,2,3\n"),
            [true, false, true]
        );
        let refused = |text| read("", text).unwrap_err().to_string();
        let text = refused("t,u,y1,y4\n0,1,2,3\n1,1,2,3\n");
        assert!(text.contains("column \"y4\""), "{text}");
        let text = refused("t,u,y\n0,1,2\n1,1,2\n");
        assert!(text.contains("1 output, the twin has 3"), "{text}");
    }

    #[test]
    fn missing_outputs_survive_the_file() {
        let text = "t,u,y1,y2\n0,1,1.5,\n0.25,2,,\n1,3,,-0.5\n";
        let record = written(&text.replace(",,\n1", ",nan,NA\n1")).unwrap();
        assert_eq!(record.missing(), 4);
        assert_eq!(record_csv_text(&record), text);
        assert_eq!(written(text).unwrap(), record);
        let one = written("t,y1,y2\n0,1,\n1,1,\n2,1,nan\n").unwrap();
        assert!(one.has_output(0) && !one.has_output(1));
        let text = message("t,y\n0,\n1,1\n2,\n");
        assert!(text.contains("1 row with a measured output"), "{text}");
    }

    #[test]
    fn a_record_survives_the_file() {
        let inputs = Signal::from_shape_fn((4, 2), |(k, j)| (k as f64 + 0.1) / (j as f64 + 3.0));
        let drive = Drive::new(0.1, inputs).unwrap();
        let outputs = Signal::from_shape_fn((4, 1), |(k, _)| (k as f64).sin() * 1e-7);
        let record = Record::new(drive, outputs).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.csv");
        record.write(&path).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(
            text.starts_with("t,u1,u2,y\n0,") && text.contains("\n0.3,"),
            "{text}"
        );
        let back = Record::read(&path).unwrap();
        assert_eq!(back.outputs(), record.outputs());
        assert_eq!(back.drive().inputs(), record.drive().inputs());
    }

    #[test]
    fn inputs_survive_the_file_and_so_do_instants_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("u.csv");
        let inputs = Signal::from_shape_fn((4, 2), |(k, j)| k as f64 / (j as f64 + 3.0));
        for (drive, begin) in [
            (Drive::new(0.1, inputs).unwrap(), "t,u1,u2\n"),
            (Drive::new(0.1, Signal::ones((3, 1))).unwrap(), "t,u\n"),
            (Drive::autonomous(0.5, 3).unwrap(), "t\n0\n0.5\n1\n"),
        ] {
            let header = columns(drive.inputs().ncols(), 0);
            let none = Signal::zeros((drive.samples(), 0));
            let text = csv_text(&header, &drive, &none);
            assert!(text.starts_with(begin), "{text}");
            std::fs::write(&path, text).unwrap();
            let back = Drive::read(&path).unwrap();
            assert_eq!(back.inputs(), drive.inputs());
            assert!((back.dt() - drive.dt()).abs() < 1e-12);
        }
    }
}
