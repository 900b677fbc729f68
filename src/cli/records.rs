//! Records of a call, with warnings about those that are likely mistakes.

use super::failure::Failure;
use super::output;
use crate::math::{six_digits, three_digits};
use crate::record::{Record, RecordReader, column_names};
use crate::setting::number;
use crate::storage::reading::is_pipe;
use crate::study::Study;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

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
    let mut records = Vec::new();
    let all: Vec<&Path> = paths
        .iter()
        .map(PathBuf::as_path)
        .chain(validation)
        .collect();
    for (number, path) in all.iter().enumerate() {
        if is_pipe(path) && all[..number].contains(path) {
            return Err(Failure::user(format!(
                "{}: it is a pipe, which can be read once; name it once",
                path.display()
            )));
        }
        let record = reader.record(path)?;
        warn_of_outlier(path, &record);
        if let Some(same) = records.iter().position(|other| *other == record) {
            let (first, path) = (paths[same].display(), path.display());
            warn(&match records.len() < paths.len() {
                true => format!(
                    "{first} and {path} hold the same record, which now counts twice; give each once"
                ),
                false => format!(
                    "{path} and {first} hold the same record; a validation record must be a second measurement"
                ),
            });
        }
        records.push(record);
    }
    let validation = validation.and_then(|_| records.pop());
    Ok((records, validation))
}

/// Warns of records whose times seem to be in another unit.
pub(super) fn warn_of_times<'r>(
    study: &Study,
    records: impl Iterator<Item = (&'r PathBuf, &'r Record)>,
    seed: u64,
) {
    for (path, record) in records {
        if let Some(message) = study.mistaken_time(record, seed) {
            warn(&format!("{}: {message}", path.display()));
        }
    }
}

/// Refuses a place for a record by a name that its reader would take for another form.
pub(super) fn check_new(place: &Path) -> Result<(), Failure> {
    match place.extension().is_some_and(|ending| ending == "parquet") {
        true => Err(Failure::user(format!(
            "{}: records are written as CSV; choose a name such as R.csv",
            place.display()
        ))),
        false => output::check_new_file(place),
    }
}

/// Warns, once of the same: each of several studies reads the records, and one that is fitted may validate, too.
fn warn(text: &str) {
    if is_new(text) {
        output::say(&format!("warning: {text}"));
    }
}

/// Returns whether this process asks it of a text for the first time.
fn is_new(text: &str) -> bool {
    static SAID: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    SAID.lock().is_ok_and(|mut said| said.insert(text.into()))
}

/// Warns of the largest value of a record if it is far beyond the others of its channel.
fn warn_of_outlier(path: &Path, record: &Record) {
    let signals = [("u", record.drive().inputs()), ("y", record.outputs())];
    for (letter, signal) in signals {
        for (j, channel) in signal.columns().into_iter().enumerate() {
            let there = channel.iter().filter(|value| !value.is_nan());
            let mut sizes: Vec<f64> = there.map(|value| value.abs()).collect();
            sizes.sort_unstable_by(f64::total_cmp);
            let Some(&largest) = sizes.last() else {
                continue;
            };
            let usual = sizes[(NEARLY_ALL * (sizes.len() - 1) as f64) as usize];
            if usual == 0.0 || largest <= FAR * usual {
                continue;
            }
            let sample = channel.iter().position(|value| value.abs() == largest);
            warn(&format!(
                "{}, row {}, column {}: {} is an outlier, 95 % of the column lie within ±{}; correct it if it is a mistake",
                path.display(),
                record.drive().rows().line(sample.unwrap_or_default()),
                column_names(letter, signal.ncols())[j],
                number(six_digits(sample.map_or(largest, |k| channel[k]))),
                number(three_digits(usual)),
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two studies that are compared read one record each for itself.
    #[test]
    fn a_warning_is_said_once() {
        let told = ["r.csv: far", "r.csv: far", "s.csv: far"].map(is_new);
        assert_eq!(told, [true, false, true]);
    }
}
