//! The beginning of a record.

use crate::record::Record;
use ndarray::s;

/// The first samples of a record; `None` where an output has no value in them.
pub(crate) fn first_part(record: &Record, samples: usize) -> Option<Record> {
    let drive = record.drive().first(samples);
    let outputs = record.outputs().slice(s![..samples, ..]).to_owned();
    Record::new(drive, outputs).ok()
}
