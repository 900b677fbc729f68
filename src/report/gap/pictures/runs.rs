//! Measured outputs and the twin.

use super::time::{mark, windows};
use crate::diagnose::Diagnosis;
use crate::report::chart::{Span, Style};
use crate::report::record::{RecordPicture, Run};
use crate::report::units::Units;
use crate::study::Study;

/// Measured outputs with the twin running free over them, before and after accepted effects, and what is left below; the windows of time
/// that stand out in the first record. `None` for the validation record where there is none.
pub fn runs(study: &Study, diagnosis: &Diagnosis, validation: bool) -> Option<String> {
    let (runs, record) = match validation {
        true => (diagnosis.validation_runs.as_ref()?, "validation record"),
        false => (&diagnosis.free_runs, "record"),
    };
    let spans = |output: &str| -> Vec<Span> {
        match validation {
            true => vec![],
            false => windows(diagnosis, output),
        }
    };
    let change = diagnosis.location.onset.as_ref().filter(|_| !validation);
    let lines = [
        ("twin, refitted", Style::BEFORE, runs.before.as_ref()),
        ("with effects", Style::AFTER, runs.after.as_ref()),
    ];
    let picture = RecordPicture {
        title: format!("{}: {record} and twin", diagnosis.twin),
        outputs: &Units::of(study).signals.outputs,
        times: &runs.times,
        measured: &runs.measured,
        runs: (lines.into_iter())
            .filter_map(|(label, style, run)| Some(Run(label, style, run?)))
            .collect(),
        spans: &spans,
        marks: change.map(mark).into_iter().collect(),
    };
    Some(picture.svg())
}
