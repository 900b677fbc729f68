//! A measured experiment.

use crate::record::{Drive, DriveError, Signal, Signals};

/// Inputs and outputs measured with one step Δt.
///
/// ```
/// use truetwin::record::{Drive, Record, Signal};
/// let drive = Drive::new(0.5, Signal::ones((3, 1)))?;
/// let record = Record::new(drive, Signal::zeros((3, 1)))?;
/// assert_eq!(record.outputs().nrows(), 3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    drive: Drive,
    outputs: Signal,
}

/// Why there is no such record, or why it does not fit a twin.
///
/// ```
/// use truetwin::record::{Drive, Record, RecordError, Signal};
///
/// let drive = Drive::autonomous(0.1, 5)?;
/// let error = Record::new(drive, Signal::zeros((4, 1))).unwrap_err();
/// assert_eq!(error, RecordError::Lengths { inputs: 5, outputs: 4 });
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// A bad time grid or input.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// Inputs and outputs differ in length.
    #[error("{inputs} rows of inputs and {outputs} rows of outputs; both need the same number")]
    Lengths {
        /// Rows of inputs.
        inputs: usize,
        /// Rows of outputs.
        outputs: usize,
    },
    /// No output channel.
    #[error("the record has no output; give at least one column y")]
    NoOutput,
    /// An output that is NaN or infinite.
    #[error("output {channel}, sample {sample} is {value}; outputs must be finite")]
    NotFinite {
        /// Channel, from 1.
        channel: usize,
        /// Sample, from 0.
        sample: usize,
        /// The value.
        value: f64,
    },
    /// Channels differ from the twin's.
    #[error(
        "the record has {given} {what}, the twin has {expected} ({names}); name its columns so"
    )]
    Channels {
        /// "inputs" or "outputs".
        what: &'static str,
        /// In the record.
        given: usize,
        /// In the twin.
        expected: usize,
        /// Columns that the file needs.
        names: String,
    },
}

impl Record {
    /// What was put in, and what came out (N × channels).
    pub fn new(drive: Drive, outputs: Signal) -> Result<Self, RecordError> {
        if outputs.nrows() != drive.samples() {
            return Err(RecordError::Lengths {
                inputs: drive.samples(),
                outputs: outputs.nrows(),
            });
        }
        if outputs.ncols() == 0 {
            return Err(RecordError::NoOutput);
        }
        if let Some(((sample, channel), &value)) =
            outputs.indexed_iter().find(|(_, v)| !v.is_finite())
        {
            return Err(RecordError::NotFinite {
                channel: channel + 1,
                sample,
                value,
            });
        }
        Ok(Self { drive, outputs })
    }

    /// Time grid and inputs.
    pub fn drive(&self) -> &Drive {
        &self.drive
    }

    /// Outputs, N × channels.
    pub fn outputs(&self) -> &Signal {
        &self.outputs
    }

    /// Number of samples N.
    pub fn samples(&self) -> usize {
        self.drive.samples()
    }

    /// Whether a twin with these channels can be compared with the record.
    pub fn check_channels(&self, signals: &Signals) -> Result<(), RecordError> {
        for (what, letter, given, expected) in [
            (
                "inputs",
                "u",
                self.drive.inputs().ncols(),
                signals.inputs.len(),
            ),
            ("outputs", "y", self.outputs.ncols(), signals.outputs.len()),
        ] {
            if given != expected {
                return Err(RecordError::Channels {
                    what,
                    given,
                    expected,
                    names: column_names(letter, expected).join(","),
                });
            }
        }
        Ok(())
    }
}

/// Column names of a record file: `u` for one channel, `u1,u2,…` for several, nothing for none.
pub(super) fn column_names(letter: &str, channels: usize) -> Vec<String> {
    match channels {
        0 => vec![],
        1 => vec![letter.into()],
        _ => (1..=channels).map(|j| format!("{letter}{j}")).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_named() {
        let drive = Drive::autonomous(0.1, 3).unwrap();
        assert!(matches!(
            Record::new(drive.clone(), Signal::zeros((2, 1))),
            Err(RecordError::Lengths { .. })
        ));
        let mut outputs = Signal::zeros((3, 2));
        outputs[[2, 1]] = f64::INFINITY;
        let error = Record::new(drive.clone(), outputs).unwrap_err().to_string();
        assert_eq!(error, "output 2, sample 2 is inf; outputs must be finite");
        let record = Record::new(drive, Signal::zeros((3, 1))).unwrap();
        let error = record.check_channels(&Signals::default()).unwrap_err();
        assert!(error.to_string().contains("0 inputs, the twin has 1 (u)"));
    }
}
