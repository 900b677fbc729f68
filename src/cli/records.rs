//! Records of a call, with warnings about those that are likely mistakes.

use super::failure::Failure;
use super::output;
use crate::record::{Record, RecordReader};
use std::path::{Path, PathBuf};

/// A value is an outlier if it exceeds this multiple of nearly all magnitudes of its channel.
const FAR: f64 = 1e6;
/// Quantile that stands for nearly all magnitudes.
const NEARLY_ALL: f64 = 0.95;

/// Reads measured records and a validation record; warns of repeated records and outlying values.
pub(super) fn read(
    mut reader: RecordReader,
    paths: &[PathBuf],
    validation: Option<&Path>,
) -> Result<(Vec<Record>, Option<Record>), Failure> {
    let records: Vec<Record> = (paths.iter())
        .map(|path| reader.record(path))
        .collect::<Result<_, _>>()?;
    let second = (validation.map(|path| reader.record(path))).transpose()?;
    let measured = || paths.iter().map(PathBuf::as_path).zip(&records);
    for (j, (path, record)) in measured().enumerate() {
        warn_of_outlier(path, record);
        if let Some((first, _)) = measured().take(j).find(|(_, other)| *other == record) {
            warn(&format!(
                "{} and {} hold the same record, which now counts twice; give each once",
                first.display(),
                path.display()
            ));
        }
    }
    if let Some((path, record)) = validation.zip(second.as_ref()) {
        warn_of_outlier(path, record);
        if let Some((first, _)) = measured().find(|(_, other)| *other == record) {
            warn(&format!(
                "{} and {} hold the same record; a validation record must be a second measurement",
                path.display(),
                first.display()
            ));
        }
    }
    Ok((records, second))
}

fn warn(text: &str) {
    output::say(&format!("warning: {text}"));
}

/// Name of the column of channel `j` of `count`.
fn column(letter: &str, count: usize, j: usize) -> String {
    match count {
        1 => letter.into(),
        _ => format!("{letter}{}", j + 1),
    }
}

/// Warns of the largest value of a record if it is far beyond the others of its channel.
fn warn_of_outlier(path: &Path, record: &Record) {
    let signals = [("u", record.drive().inputs()), ("y", record.outputs())];
    for (letter, signal) in signals {
        for (j, channel) in signal.columns().into_iter().enumerate() {
            let there = channel.iter().filter(|value| !value.is_nan());
            let mut sizes: Vec<f64> = there.map(|value| value.abs()).collect();
            sizes.sort_unstable_by(f64::total_cmp);
            let usual = sizes[(NEARLY_ALL * (sizes.len() - 1) as f64) as usize];
            let largest = sizes[sizes.len() - 1];
            if usual == 0.0 || largest <= FAR * usual {
                continue;
            }
            let sample = channel.iter().position(|value| value.abs() == largest);
            warn(&format!(
                "{}, row {}, column {}: {:?} is an outlier, 95 % of the column lie within ±{usual:?}; correct it if it is a mistake",
                path.display(),
                sample.unwrap_or_default() + 2,
                column(letter, signal.ncols(), j),
                sample.map_or(largest, |k| channel[k]),
            ));
        }
    }
}
