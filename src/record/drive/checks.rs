//! Checks of inputs and signals.

use super::Signal;
use crate::math::three_digits;
use crate::record::channels::LARGEST;
use crate::record::{Quantity, RecordError};
use crate::setting::count;

/// Checks that a row has the inputs of the one before it, which has the same time.
pub(super) fn check_replicate(inputs: &Signal, row: usize) -> Result<(), RecordError> {
    let (own, before) = (inputs.row(row), inputs.row(row - 1));
    match (own.iter().zip(before)).position(|(own, before)| own != before) {
        None => Ok(()),
        Some(j) => Err(RecordError::ReplicateInputs {
            sample: row,
            channel: j + 1,
            value: own[j],
            before: before[j],
        }),
    }
}

pub(super) fn check_rows(times: usize, inputs: &Signal) -> Result<(), RecordError> {
    match inputs.nrows() {
        rows if rows == times => Ok(()),
        rows => Err(RecordError::Lengths(format!(
            "{} and {} of inputs",
            count(times, "time"),
            count(rows, "row")
        ))),
    }
}

/// Refuses a signal of which one value is `wrong`.
pub(in crate::record) fn check_values(
    signal: &Signal,
    kind: &'static str,
    wrong: impl Fn(f64) -> bool,
) -> Result<(), RecordError> {
    match signal.indexed_iter().find(|(_, value)| wrong(**value)) {
        None => Ok(()),
        Some(((sample, channel), &value)) => Err(RecordError::NotFinite {
            kind,
            channel: channel + 1,
            sample,
            value,
        }),
    }
}

/// Checks that the channels of a signal have sizes that can be computed with.
pub(crate) fn check_sizes(
    signal: &Signal,
    kind: &'static str,
    quantities: &[Quantity],
) -> Result<(), RecordError> {
    for (channel, values) in signal.columns().into_iter().enumerate() {
        let size = values.fold(0.0, |a: f64, v| a.max(v.abs()));
        check_size(kind, size, || match quantities.get(channel) {
            Some(own) => own.name.clone(),
            None => (channel + 1).to_string(),
        })?;
    }
    Ok(())
}

/// Checks that a signal of this size can be computed with; `name` is asked where it cannot.
pub(crate) fn check_size(
    kind: &'static str,
    size: f64,
    name: impl FnOnce() -> String,
) -> Result<(), RecordError> {
    match size > LARGEST || (size > 0.0 && size < 1.0 / LARGEST) {
        true => Err(RecordError::Size {
            kind,
            name: name(),
            size: three_digits(size),
        }),
        false => Ok(()),
    }
}

/// A signal of one slice a channel.
pub(in crate::record) fn signal(channels: &[impl AsRef<[f64]>]) -> Result<Signal, RecordError> {
    let rows = channels.first().map_or(0, |first| first.as_ref().len());
    let other = |channel: &&_| AsRef::<[f64]>::as_ref(*channel).len() != rows;
    if let Some(other) = channels.iter().find(other) {
        let other = other.as_ref().len();
        let problem = format!("channels of {rows} and of {other} samples");
        return Err(RecordError::Lengths(problem));
    }
    Ok(Signal::from_shape_fn((rows, channels.len()), |(k, j)| {
        channels[j].as_ref()[k]
    }))
}
