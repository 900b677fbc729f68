//! Records and inputs as text and as new files.

use super::channels::column_names;
use crate::record::{Drive, Record, RecordError, Signal};
use crate::storage::files::write_new;
use std::path::Path;

/// The text of an input file, as [`Drive::read`] reads it.
pub(crate) fn drive_csv_text(drive: &Drive) -> String {
    csv_text(drive, &Signal::zeros((drive.samples(), 0)))
}

/// The text of a record file; reading it gives the same bits of u and y, and of t where steps vary. A missing output is an empty cell.
pub(crate) fn record_csv_text(record: &Record) -> String {
    csv_text(record.drive(), record.outputs())
}

fn csv_text(drive: &Drive, outputs: &Signal) -> String {
    let mut header = vec!["t".to_owned()];
    header.extend(column_names("u", drive.inputs().ncols()));
    header.extend(column_names("y", outputs.ncols()));
    let mut text = header.join(",");
    text.push('\n');
    for k in 0..drive.samples() {
        let t = match drive.is_uniform() {
            true => rounded_time(drive.time(k), drive.dt()),
            false => drive.time(k),
        };
        text.push_str(&t.to_string());
        for value in drive.input(k).iter().chain(outputs.row(k)) {
            text.push(',');
            if !value.is_nan() {
                text.push_str(&value.to_string());
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
        write_new(path, record_csv_text(self).as_bytes())
            .map_err(|error| RecordError::io(path, error))
    }
}

/// Time to a billionth of the step, so that 3·0.1 is written as 0.3.
fn rounded_time(t: f64, dt: f64) -> f64 {
    let digits = 10f64.powi(9 - dt.log10().floor() as i32);
    let rounded = (t * digits).round() / digits;
    if rounded.is_finite() { rounded } else { t }
}
