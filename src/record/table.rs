//! The numbers of a record file, checked cell by cell.

use super::channels::column_names;
use crate::record::{Drive, Record, RecordError, Signal};
use crate::setting::number;
use crate::storage::untrusted::{MOST_NUMBERS, Rows, excerpt, quoted};
use std::io::{Cursor, Read};
use std::path::Path;

/// Longest record: a sample a millisecond for half a day.
const MOST_SAMPLES: usize = 50_000_000;
/// Most columns: t and a thousand inputs and outputs each.
const MOST_COLUMNS: usize = 2001;
/// Largest measured value: squares and sums of squares of a record must stay finite.
const LARGEST: f64 = 1e100;

/// The numbers of a file.
pub(super) struct Table {
    times: Vec<f64>,
    inputs: Signal,
    outputs: Signal,
}

impl Table {
    /// The table as time and inputs alone.
    pub fn drive(self, path: &Path) -> Result<Drive, RecordError> {
        if self.outputs.ncols() > 0 {
            let names = excerpt(&column_names("y", self.outputs.ncols()).join(","));
            let problem =
                format!("{names}: an input file has t and inputs alone; remove the output columns");
            return Err(RecordError::file(path, problem));
        }
        Drive::with_times(&self.times, self.inputs).map_err(|error| RecordError::file(path, error))
    }

    /// The table as a record, which needs outputs.
    pub fn record(self, path: &Path) -> Result<Record, RecordError> {
        if self.outputs.ncols() == 0 {
            let problem = "no output column; a record needs y, or y1,y2,…";
            return Err(RecordError::file(path, problem));
        }
        (Drive::with_times(&self.times, self.inputs))
            .and_then(|drive| Record::new(drive, self.outputs))
            .map_err(|error| RecordError::file(path, error))
    }

    pub fn parse(mut text: impl Read, path: &Path) -> Result<Self, RecordError> {
        let mut start = Vec::new();
        (text.by_ref().take(START).read_to_end(&mut start))
            .map_err(|error| RecordError::io(path, error))?;
        check_encoding(&start).map_err(|problem| RecordError::file(path, problem))?;
        let mut reader = Rows::new(Cursor::new(start).chain(text));
        let header = reader.header().map_err(|e| csv_error(path, e))?;
        let large = |problem: String| {
            let remedy = "cut the record into shorter ones, or resample it";
            RecordError::file(path, format!("{problem}; {remedy}"))
        };
        if header.len() > MOST_COLUMNS {
            let given = header.len();
            return Err(large(format!(
                "{given} columns, at most {MOST_COLUMNS} are read"
            )));
        }
        let (inputs, outputs) =
            channels(&header).map_err(|problem| RecordError::file(path, problem))?;
        let columns = 1 + inputs + outputs;
        // Index of column j of the file in a row ordered t, u1, u2, …, y1, y2, ….
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
                row[place] = cell_value(cell, name).map_err(|problem| {
                    let row = cells.position().map_or(t.len() + 2, |p| p.line() as usize);
                    RecordError::cell(path, row, name, problem)
                })?;
            }
            t.push(row[0]);
            u.extend_from_slice(&row[1..=inputs]);
            y.extend_from_slice(&row[1 + inputs..]);
        }
        let rows = t.len();
        if rows < 2 {
            let problem = format!("{rows} rows of data; at least 2 are needed to know the step");
            return Err(RecordError::file(path, problem));
        }
        check_order(path, &t)?;
        let signal = |width: usize, values: Vec<f64>| {
            Signal::from_shape_vec((rows, width), values)
                .map_err(|error| RecordError::file(path, error))
        };
        Ok(Self {
            times: t,
            inputs: signal(inputs, u)?,
            outputs: signal(outputs, y)?,
        })
    }
}

/// Bytes of a file that tell its encoding.
const START: u64 = 64;

/// Refuses text that is not UTF-8 by its first bytes.
fn check_encoding(start: &[u8]) -> Result<(), String> {
    let utf16 = start.starts_with(b"\xff\xfe") || start.starts_with(b"\xfe\xff");
    if utf16 || start.contains(&0) {
        let encoding = if utf16 { "UTF-16" } else { "UTF-16 or binary" };
        return Err(format!("the file is {encoding}; save it as UTF-8 text"));
    }
    Ok(())
}

/// Parses a cell of a column. An output may be missing, which is NaN here.
fn cell_value(cell: &str, column: &str) -> Result<f64, String> {
    let missing = cell.is_empty() || cell == "NA" || cell.eq_ignore_ascii_case("nan");
    match column.as_bytes().first() {
        _ if !missing => parse_number(cell),
        Some(b'y') => Ok(f64::NAN),
        Some(b'u') => Err(
            "no value; an input is needed in each row: give the one that acted, or remove the row"
                .into(),
        ),
        _ => Err("no value; each row needs its time: give it, or remove the row".into()),
    }
}

/// Parses a number.
fn parse_number(cell: &str) -> Result<f64, String> {
    match cell.parse::<f64>() {
        Ok(value) if value.is_finite() && value.abs() > LARGEST => Err(format!(
            "{} is beyond ±{LARGEST:e}, the largest value of a record; correct or remove the row",
            excerpt(cell)
        )),
        Ok(value) if value.is_finite() => Ok(value),
        _ if cell.contains(',') && cell.replacen(',', ".", 1).parse::<f64>().is_ok() => {
            Err(format!(
                "\"{}\" has a decimal comma; write decimal points",
                quoted(cell)
            ))
        }
        _ => Err(format!(
            "\"{}\" is no finite number; correct it, or leave the cell of an output empty if it was not measured",
            quoted(cell)
        )),
    }
}

/// The parser's error, by row.
fn csv_error(path: &Path, error: csv::Error) -> RecordError {
    let row = |position: Option<csv::Position>| position.map_or(0, |p| p.line());
    let problem = match error.into_kind() {
        csv::ErrorKind::Io(error) => return RecordError::io(path, error),
        csv::ErrorKind::UnequalLengths {
            pos,
            expected_len,
            len,
        } => {
            let comma = if len > expected_len {
                "; write decimal points, not commas"
            } else {
                ""
            };
            format!(
                "row {} has {len} cells, the header has {expected_len}{comma}",
                row(pos)
            )
        }
        csv::ErrorKind::Utf8 { pos, err } => format!("row {}: {err}", row(pos)),
        other => format!("{other:?}"),
    };
    let remedy = "a record is UTF-8 text, each row with as many cells as the header";
    RecordError::file(path, format!("{problem}; {remedy}"))
}

/// Number of inputs and outputs that a header names: each of t, u…, y… once and without gaps.
fn channels(header: &csv::StringRecord) -> Result<(usize, usize), String> {
    if header.iter().all(str::is_empty) {
        return Err("the file is empty; a record needs a header t,u,y and rows".into());
    }
    for (separator, name) in [(';', "semicolons"), ('\t', "tabs")] {
        if header.len() == 1 && header[0].contains(separator) {
            return Err(format!(
                "columns are separated by {name}; separate them by commas, and write decimal points"
            ));
        }
    }
    let names: Vec<&str> = header.iter().collect();
    let count = |letter: char| names.iter().filter(|n| n.starts_with(letter)).count();
    let (inputs, outputs) = (count('u'), count('y'));
    let mut expected = vec!["t".to_owned()];
    expected.extend(column_names("u", inputs));
    expected.extend(column_names("y", outputs));
    let rename = || format!("rename the columns to {}", excerpt(&expected.join(",")));
    if let Some((_, name)) = (names.iter().enumerate()).find(|(j, name)| names[..*j].contains(name))
    {
        return Err(match *name {
            "t" => "column t appears twice; remove one".into(),
            name => format!("column \"{}\" appears twice; {}", quoted(name), rename()),
        });
    }
    let channel =
        |name: &str| name.starts_with(['u', 'y']) && name[1..].chars().all(|c| c.is_ascii_digit());
    if let Some(name) = names.iter().find(|name| **name != "t" && !channel(name)) {
        return Err(format!(
            "column \"{}\" is not part of a record; name the columns t, u or u1,u2,…, y or y1,y2,… and remove others",
            quoted(name)
        ));
    }
    let known = |name: &str| {
        expected.iter().any(|e| e == name)
            || (name == "u1" && inputs == 1)
            || (name == "y1" && outputs == 1)
    };
    if let Some(name) = names.iter().find(|name| !known(name)) {
        return Err(format!(
            "column \"{}\" is out of order; {}",
            excerpt(name),
            rename()
        ));
    }
    if !names.contains(&"t") {
        return Err("column t is missing; add the time of each row in seconds".into());
    }
    Ok((inputs, outputs))
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

/// Checks that time increases from row to row, by steps that can be computed with.
fn check_order(path: &Path, t: &[f64]) -> Result<(), RecordError> {
    for (k, pair) in t.windows(2).enumerate() {
        let step = pair[1] - pair[0];
        if step <= 0.0 {
            let problem = format!(
                "{} s follows {} s; time must increase: sort the rows, remove repeated ones",
                number(pair[1]),
                number(pair[0])
            );
            return Err(RecordError::cell(path, k + 3, "t", problem));
        }
        if !step.is_normal() {
            let problem = format!(
                "column t: a step of {} s is too small to compute with; write t in seconds",
                number(step)
            );
            return Err(RecordError::file(path, problem));
        }
    }
    Ok(())
}
