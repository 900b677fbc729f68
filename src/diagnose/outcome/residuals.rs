//! One-step residuals of the twin that was accepted.

use crate::likelihood::kalman::Filtered;
use crate::record::{Record, Signal};

/// One-step residuals of one record beside its inputs.
#[derive(Debug, Clone, PartialEq)]
pub struct Residuals {
    /// Inputs, N × inputs.
    pub inputs: Signal,
    /// Prediction errors over their standard deviation, N × outputs; white noise of size 1 if the twin is right. NaN where nothing was
    /// measured.
    pub outputs: Signal,
}

impl Residuals {
    /// The residuals of filtered records.
    pub(in crate::diagnose) fn of(records: &[Record], filtered: Vec<Filtered>) -> Vec<Self> {
        (records.iter().zip(filtered))
            .map(|(record, filtered)| Self {
                inputs: record.drive().inputs().clone(),
                outputs: filtered.standardised,
            })
            .collect()
    }
}
