//! The numbers of a record file, checked cell by cell.

use super::channels::{Signals, columns, is_usual, names_in_brackets};
use super::columns::Wanted;
use super::drive::FileRows;
use super::stamp::Stamp;
use super::text::{Decimals, Text, separator_name};
use crate::record::{Drive, LARGEST, Record, RecordError, Signal};
use crate::setting::{count, number};
use crate::storage::untrusted::{MOST_NUMBERS, Rows, excerpt, quoted};
use std::path::Path;

/// Longest record: a sample a millisecond for half a day.
pub(crate) const MOST_SAMPLES: usize = 50_000_000;
/// Most columns: t and a thousand inputs and outputs each.
const MOST_COLUMNS: usize = 2001;

/// The numbers of a file.
pub(super) struct Table {
    /// Names of the columns of time, inputs and outputs; an output without a column has none.
    names: Vec<String>,
    times: Vec<f64>,
    inputs: Signal,
    outputs: Signal,
    rows: FileRows,
}

impl Table {
    /// Names of the columns: time, inputs, outputs.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The table as time and inputs alone.
    pub fn drive(self, path: &Path) -> Result<Drive, RecordError> {
        if self.outputs.ncols() > 0 {
            let names = excerpt(&self.names[1 + self.inputs.ncols()..].join(","));
            let problem =
                format!("{names}: an input file has t and inputs alone; remove the output columns");
            return Err(RecordError::file(path, problem));
        }
        match Drive::with_times(&self.times, self.inputs) {
            Ok(drive) => Ok(drive.read_from(self.rows)),
            Err(error) => Err(in_file(error, path, &self.names, &self.rows)),
        }
    }

    /// The table as a record, which needs outputs.
    pub fn record(self, path: &Path) -> Result<Record, RecordError> {
        if self.outputs.ncols() == 0 {
            let problem = "no output column; a record needs y, or y1,y2,…";
            return Err(RecordError::file(path, problem));
        }
        (Drive::with_times(&self.times, self.inputs))
            .and_then(|drive| Record::new(drive.read_from(self.rows.clone()), self.outputs))
            .map_err(|error| in_file(error, path, &self.names, &self.rows))
    }

    /// Parses a table; `read` counts the numbers of this file and those before.
    pub fn parse(
        text: Text<'_>,
        path: &Path,
        wanted: Wanted<'_>,
        read: &mut usize,
    ) -> Result<Self, RecordError> {
        let separator = text.separator;
        let mut reader = Rows::separated(text.text, separator);
        let header = (reader.header()).map_err(|error| {
            let line = reader.line();
            csv_error(path, separator, line, error)
        })?;
        let large = |problem: String| {
            let remedy = "cut the record into shorter ones, or resample it";
            RecordError::file(path, format!("{problem}; {remedy}"))
        };
        let header: Vec<&str> = header.iter().collect();
        if header.len() > MOST_COLUMNS {
            let problem = format!("{} columns, at most {MOST_COLUMNS} are read", header.len());
            return Err(large(problem));
        }
        if wanted.is_usual() {
            check_header(&header, reader.line(), path)?;
        }
        let (usual, inputs, outputs) = (wanted.usual_names(&header))
            .and_then(|usual| {
                let names: Vec<ColumnName<'_>> = (usual.iter().zip(&header))
                    .filter_map(|(usual, own)| Some((usual.as_deref()?, *own)))
                    .collect();
                let (inputs, outputs) = channels(&names, wanted.signals())?;
                Ok((usual, inputs, outputs))
            })
            .map_err(|problem| RecordError::Columns {
                path: path.into(),
                problem,
            })?;
        let width = 1 + inputs + outputs;
        // Index of column j of the file in a row ordered t, u1, u2, …, y1, y2, …; none for one that is left out.
        let places: Vec<Option<usize>> = (usual.iter())
            .map(|name| name.as_ref().map(|name| place(name, inputs)))
            .collect();
        let mut names = vec![String::new(); width];
        for (place, name) in places.iter().zip(&header) {
            if let Some(place) = *place {
                names[place] = (*name).into();
            }
        }
        // Numbers alone are kept, and each once: a record may fill half of the memory.
        let (mut t, mut u, mut y) = (Vec::new(), Vec::new(), Vec::new());
        // An output without a column is missing.
        let mut row = vec![f64::NAN; width];
        let mut cells = csv::StringRecord::new();
        let mut parser = CellParser::new(separator, inputs);
        let mut surplus: Vec<(usize, usize)> = vec![];
        while (reader.read(&mut cells))
            .map_err(|error| csv_error(path, separator, reader.line(), error))?
        {
            if t.len() == MOST_SAMPLES {
                return Err(large(format!("more than {MOST_SAMPLES} samples")));
            }
            *read += width;
            if *read > MOST_NUMBERS {
                let most = number(MOST_NUMBERS as f64);
                return Err(large(format!("more than {most} numbers in all records")));
            }
            let number = reader.line();
            let lines = number.saturating_sub(t.len() + 2);
            if surplus.last().map_or(0, |(_, lines)| *lines) != lines {
                surplus.push((t.len(), lines));
            }
            for ((cell, place), name) in cells.iter().zip(&places).zip(&header) {
                if let Some(place) = *place {
                    row[place] = (parser.parse(cell, place, number)).map_err(|problem| {
                        let row = t.is_empty().then_some(&cells);
                        cell_error(path, (number, name), row, problem)
                    })?;
                }
            }
            t.push(row[0]);
            u.extend_from_slice(&row[1..=inputs]);
            y.extend_from_slice(&row[1 + inputs..]);
        }
        let rows = t.len();
        if rows < 2 {
            let given = count(rows, "row");
            let problem = format!("{given} of data; at least 2 are needed to know the step");
            return Err(RecordError::file(path, problem));
        }
        let signal = |width: usize, values: Vec<f64>| {
            Signal::from_shape_vec((rows, width), values)
                .map_err(|error| RecordError::file(path, error))
        };
        Ok(Self {
            rows: FileRows::of(surplus, &names, parser.first.is_some()),
            names,
            times: t,
            inputs: signal(inputs, u)?,
            outputs: signal(outputs, y)?,
        })
    }
}

/// Adds file, row and column to an error of the numbers of a table.
fn in_file(error: RecordError, path: &Path, names: &[String], rows: &FileRows) -> RecordError {
    match error {
        RecordError::TimeOrder { sample, .. } => {
            RecordError::cell(path, rows.line(sample), &names[0], error.to_string())
        }
        RecordError::ReplicateInputs {
            sample, channel, ..
        } => RecordError::cell(path, rows.line(sample), &names[channel], error.to_string()),
        RecordError::Step(step) => RecordError::file(
            path,
            format!(
                "column {}: a step of {} s is too small to compute with; write t in seconds",
                quoted(&names[0]),
                number(step)
            ),
        ),
        error => error.within(path),
    }
}

/// Parses cells of one file.
struct CellParser {
    separator: u8,
    inputs: usize,
    decimals: Decimals,
    /// First time stamp; none where times are numbers.
    first: Option<Stamp>,
    /// `true` once a time was a number.
    has_seconds: bool,
}

impl CellParser {
    fn new(separator: u8, inputs: usize) -> Self {
        Self {
            separator,
            inputs,
            decimals: Decimals::default(),
            first: None,
            has_seconds: false,
        }
    }

    /// Parses a cell at `place` in a row ordered t, u1, …, y1, …. An output may be missing, which is NaN here.
    fn parse(&mut self, cell: &str, place: usize, row: usize) -> Result<f64, String> {
        let missing = cell.is_empty() || cell == "NA" || cell.eq_ignore_ascii_case("nan");
        match place {
            0 if missing => Err("no value; each row needs its time: give it, or remove the row".into()),
            0 => self.time(cell, row),
            _ if !missing => self.number(cell, row),
            input if input <= self.inputs => Err(
                "no value; an input is needed in each row: give the one that acted, or remove the row"
                    .into(),
            ),
            _ => Ok(f64::NAN),
        }
    }

    /// Parses a time: seconds, or a stamp, whose seconds count from the first one.
    fn time(&mut self, cell: &str, row: usize) -> Result<f64, String> {
        match (Stamp::parse(cell), self.first) {
            (Some(_), _) if self.has_seconds => Err(format!(
                "\"{}\" is a time stamp, earlier times are seconds; write one kind",
                quoted(cell)
            )),
            (Some(stamp), first) => stamp.since(*self.first.insert(first.unwrap_or(stamp))),
            (None, Some(_)) => Err(not_a_stamp(cell)),
            (None, None) => {
                self.has_seconds = true;
                self.number(cell, row)
                    .map_err(|problem| match Stamp::is_meant(cell) {
                        true if cell.parse::<f64>().is_err() => not_a_stamp(cell),
                        _ => problem,
                    })
            }
        }
    }

    /// Parses a number that can be computed with; with a decimal comma if commas do not separate the columns.
    fn number(&mut self, cell: &str, row: usize) -> Result<f64, String> {
        let value = match self.separator {
            b',' => None,
            _ => self.decimals.parse(cell, row)?,
        };
        match value.or_else(|| cell.parse().ok()) {
            Some(value) if value.abs() <= LARGEST => Ok(value),
            Some(value) if value.is_finite() => Err(format!(
                "{} is beyond ±{LARGEST:e}, the largest value of a record; correct or remove the row",
                number(value)
            )),
            None if cell.contains(',') && cell.replacen(',', ".", 1).parse::<f64>().is_ok() => {
                Err(format!(
                    "\"{}\" has a decimal comma; write decimal points, or separate the columns by semicolons",
                    quoted(cell)
                ))
            }
            _ => Err(format!(
                "\"{}\" is no finite number; correct it, or leave the cell of an output empty if it was not measured",
                quoted(cell)
            )),
        }
    }
}

/// The error of a cell, or of its row where that is the first one and has no number: units stand in such a row.
fn cell_error(
    path: &Path,
    (row, column): (usize, &str),
    first: Option<&csv::StringRecord>,
    problem: String,
) -> RecordError {
    let is_number = |cell: &str| {
        Stamp::parse(cell).is_some() || cell.replace(',', ".").trim().parse::<f64>().is_ok()
    };
    match first.is_some_and(|cells| !cells.iter().any(is_number)) {
        true => {
            let problem = format!("row {row} has no number; remove it, if it has units");
            RecordError::file(path, problem)
        }
        false => RecordError::cell(path, row, column, problem),
    }
}

fn not_a_stamp(cell: &str) -> String {
    format!(
        "\"{}\" is no time stamp of ISO 8601; write 2024-03-31T14:00:00.5, with Z or +02:00 if it has a zone, or seconds",
        quoted(cell)
    )
}

/// The parser's error, by row.
fn csv_error(path: &Path, separator: u8, row: usize, error: csv::Error) -> RecordError {
    let problem = match error.into_kind() {
        csv::ErrorKind::Io(error) => return RecordError::io(path, error),
        csv::ErrorKind::UnequalLengths {
            expected_len, len, ..
        } => {
            let comma = if len > expected_len && separator == b',' {
                "; write decimal points, or separate the columns by semicolons"
            } else {
                ""
            };
            format!(
                "row {row} has {}, the header has {expected_len}, separated by {}{comma}",
                count(len as usize, "cell"),
                separator_name(separator)
            )
        }
        csv::ErrorKind::Utf8 { err, .. } => {
            format!("row {row}, column {} is no UTF-8", err.field() + 1)
        }
        _ => format!("row {row} is no row of a CSV file"),
    };
    let remedy = "a record is UTF-8 text, each row with as many cells as the header";
    RecordError::file(path, format!("{problem}; {remedy}"))
}

/// Checks that a file begins with names of columns.
fn check_header(names: &[&str], row: usize, path: &Path) -> Result<(), RecordError> {
    let is_number = |name: &&str| name.replacen(',', ".", 1).parse::<f64>().is_ok();
    let problem = if names.iter().all(|name| name.is_empty()) {
        "the file is empty; a record needs a header t,u,y and rows".into()
    } else if names.iter().all(is_number) {
        format!(
            "row {row} holds numbers, not the names of the columns; add a row before it such as t,u,y"
        )
    } else {
        return Ok(());
    };
    Err(RecordError::file(path, problem))
}

/// The usual name of a column, and its own.
type ColumnName<'a> = (&'a str, &'a str);

/// Number of inputs and outputs of a header: each of t, u…, y… once and without gaps. Of the twin's outputs, some may be left out.
fn channels(all: &[ColumnName<'_>], signals: Option<&Signals>) -> Result<(usize, usize), String> {
    let names: Vec<&str> = all.iter().map(|(usual, _)| *usual).collect();
    let twin = signals.map_or(0, |signals| signals.outputs.len());
    let count = |letter: char| names.iter().filter(|n| n.starts_with(letter)).count();
    let number = |name: &&str| name.strip_prefix('y')?.parse::<usize>().ok();
    let is_of_twin = |name: &&str| number(name).is_some_and(|n| (1..=twin).contains(&n));
    let (inputs, mut outputs) = (count('u'), count('y'));
    let mut of_outputs = names.iter().filter(|name| name.starts_with('y'));
    if (1..twin).contains(&outputs) && of_outputs.all(is_of_twin) {
        outputs = twin;
    }
    let expected = columns(inputs, outputs);
    let rename = format!("rename the columns to {}", excerpt(&expected.join(",")));
    if names.iter().filter(|name| **name == "t").count() > 1 {
        return Err("column t appears twice; remove one".into());
    }
    for (name, own) in all {
        let is_repeated = names.iter().filter(|other| *other == name).count() > 1;
        let is_expected = match *name {
            "u1" if inputs == 1 => true,
            "y1" if outputs == 1 => true,
            name => expected.iter().any(|e| e == name),
        };
        let problem = match *name {
            _ if is_repeated => &format!("appears twice; {rename}"),
            name if !is_usual(name) => {
                "is not part of a record; name the columns t, u or u1,u2,…, y or y1,y2,…, and remove others"
            }
            _ if !is_expected => match signals.and_then(|signals| other_number(all, signals)) {
                Some(problem) => return Err(problem),
                None => &format!("is out of order; {rename}"),
            },
            _ => continue,
        };
        return Err(format!("column \"{}\" {problem}", quoted(own)));
    }
    match names.contains(&"t") {
        true => Ok((inputs, outputs)),
        false => Err(
            "column t is missing; add the time of each row in seconds, or name its column t".into(),
        ),
    }
}

/// Says which channels a file has more of than the twin, or of inputs fewer.
fn other_number(all: &[ColumnName<'_>], signals: &Signals) -> Option<String> {
    let sides = [
        ("u", "input", &signals.inputs),
        ("y", "output", &signals.outputs),
    ];
    sides.into_iter().find_map(|(letter, kind, channels)| {
        let of_file = all.iter().filter(|(usual, _)| usual.starts_with(letter));
        let of_file: Vec<&str> = of_file.map(|(_, own)| *own).collect();
        let expected = channels.len();
        let is_short = kind == "input" && of_file.len() < expected;
        (is_short || of_file.len() > expected).then(|| {
            format!(
                "the record has {} ({}), the twin has {expected}{}; choose the twin that this record is of, or correct the columns",
                count(of_file.len(), kind),
                excerpt(&of_file.join(",")),
                names_in_brackets(letter, expected)
            )
        })
    })
}

/// Index of a column in a row: t first, then inputs, then outputs.
fn place(name: &str, inputs: usize) -> usize {
    let number = name[1..].parse::<usize>().unwrap_or(1);
    match name.as_bytes()[0] {
        b'u' => number,
        b'y' => inputs + number,
        _ => 0,
    }
}
