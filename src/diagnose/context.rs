//! Inputs that all steps of a diagnosis share.

use crate::record::Record;
use crate::study::Study;
use crate::twin::{Now, Twin};

/// Inputs that all steps of a diagnosis share.
pub(super) struct Context<'a> {
    pub study: &'a Study,
    pub twin: &'a Twin,
    pub validation: Option<&'a [Record]>,
    /// The records and the validation record.
    pub together: Option<&'a [Record]>,
    /// True for a twin without process noise: its free run is to follow the record, and neither noise nor a disturbance
    /// is a rival: either would explain anything.
    pub follows: bool,
    /// True for a simulator without noise of its own, which has been given measurement noise.
    pub silent: bool,
}

impl<'a> Context<'a> {
    /// Collects the inputs; the twin is that of [`measured`](crate::likelihood::ensemble::measured).
    pub fn new(
        study: &'a Study,
        (twin, silent): &'a (Twin, bool),
        records: &[Record],
        validation: Option<&'a [Record]>,
        together: Option<&'a [Record]>,
    ) -> Self {
        Self {
            study,
            twin,
            validation,
            together,
            follows: *silent || without_process_noise(twin, &records[0]),
            silent: *silent,
        }
    }
}

/// Returns true where no state of the twin is noisy; false for a black box, of which nobody knows.
fn without_process_noise(twin: &Twin, record: &Record) -> bool {
    let Some(twin) = twin.equations() else {
        return false;
    };
    let outline = twin.outline();
    let theta = outline.parameters.centre();
    let drive = record.drive();
    let now = Now::new(0.0, drive.dt(), drive.input(0), &theta);
    let mut process = vec![0.0; outline.states.len()];
    let mut measurement = vec![0.0; outline.outputs.len()];
    twin.noise(&now, &mut process, &mut measurement);
    process.iter().all(|q| *q == 0.0)
}
