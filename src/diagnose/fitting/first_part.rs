//! The beginning of a record.

use crate::record::{Drive, Record, RecordError};
use ndarray::s;

/// The first samples of a record.
pub(in crate::diagnose) fn first_part(
    record: &Record,
    samples: usize,
) -> Result<Record, RecordError> {
    let drive = record.drive();
    let inputs = drive.inputs().slice(s![..samples, ..]).to_owned();
    let drive = Drive::new(drive.dt(), inputs)?;
    let outputs = record.outputs().slice(s![..samples, ..]).to_owned();
    Record::new(drive, outputs)
}
