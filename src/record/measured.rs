//! A measured experiment.

use super::channels::column_names;
use crate::record::{Drive, RecordError, Signal, Signals};

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

impl Record {
    /// A record of inputs under `drive` and outputs (N × channels).
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
                kind: "output",
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

    /// Checks that a twin with these channels can be compared with the record.
    pub fn check_channels(&self, signals: &Signals) -> Result<(), RecordError> {
        for (kind, letter, given, expected) in [
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
                    kind,
                    given,
                    expected,
                    names: column_names(letter, expected).join(","),
                });
            }
        }
        Ok(())
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
