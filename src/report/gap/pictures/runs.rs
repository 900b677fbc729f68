//! Measured outputs and the twin.

use super::windows::{mark, windows};
use crate::diagnose::{Diagnosis, FreeRuns};
use crate::report::chart::{Chart, Panel, Series, Style, roomy};
use crate::report::digits::{named, short};
use crate::report::units::Units;
use crate::study::Study;

/// Measured outputs with the twin running free over them, before and after accepted effects; below the first record the
/// windows of time that stand out. `None` for the validation record where there is none.
///
/// Runs that leave the range of the measured values are cut off.
pub fn runs(study: &Study, diagnosis: &Diagnosis, validation: bool) -> Option<String> {
    let runs = if validation {
        diagnosis.validation_runs.as_ref()?
    } else {
        &diagnosis.free_runs
    };
    let outputs = Units::of(study).signals.outputs;
    let panels = (outputs.iter().enumerate())
        .map(|(j, output)| {
            let panel = Panel::new(&named(output), series(runs, j));
            if validation {
                panel
            } else {
                let change = diagnosis.location.onset.as_ref().map(mark);
                (panel.spans(windows(diagnosis, &output.name))).marks(change.into_iter().collect())
            }
        })
        .collect();
    let record = if validation {
        "validation record"
    } else {
        "record"
    };
    let after = match runs.after {
        Some(_) => ", and with the accepted effects",
        None => "",
    };
    let (name, end) = (&diagnosis.twin, runs.times.last().copied().unwrap_or(0.0));
    let chart = Chart {
        title: format!("{name}: {record} and twin"),
        description: format!(
            "Measured outputs of the {record} over {} s; the refitted twin without noise{after}.",
            short(end)
        ),
        x: "t in s".into(),
        panels,
    };
    Some(chart.svg())
}

/// Lines of one output.
fn series(runs: &FreeRuns, channel: usize) -> Vec<Series> {
    let shown = roomy(runs.measured.column(channel).iter().copied());
    let lines = [
        ("measured", Style::RECORD, Some(&runs.measured)),
        ("twin, refitted", Style::BEFORE, runs.before.as_ref()),
        ("with effects", Style::AFTER, runs.after.as_ref()),
    ];
    (lines.into_iter())
        .filter_map(|(label, style, signal)| {
            let values = signal?.column(channel).to_vec();
            let points = runs.times.iter().copied().zip(values);
            Some(Series::new(label, style, points).within(shown.clone()))
        })
        .collect()
}
