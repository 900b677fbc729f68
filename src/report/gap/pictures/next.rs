//! The record to measure next.

use crate::diagnose::Diagnosis;
use crate::report::chart::{Chart, Panel, Series, Style};
use crate::report::digits::{named, short};
use crate::report::units::Units;
use crate::study::Study;

/// The proposed inputs against time, held over each step; `None` where none is proposed, or the twin has no input.
pub fn next_input(study: &Study, diagnosis: &Diagnosis) -> Option<String> {
    let next = diagnosis.cause.next_input.as_ref()?;
    let drive = &next.drive;
    let inputs = Units::of(study).signals.inputs;
    if inputs.is_empty() {
        return None;
    }
    let panels = (inputs.iter().enumerate())
        .filter(|(j, _)| *j < drive.inputs().ncols())
        .map(|(j, input)| {
            let held = (0..drive.samples()).flat_map(|k| {
                let u = drive.input(k)[j];
                [(drive.time(k), u), (drive.time(k + 1), u)]
            });
            Panel::new(&named(input), vec![Series::new("", Style::AFTER, held)]).height(120.0)
        })
        .collect();
    let chart = Chart {
        title: "The input to measure with next".into(),
        description: format!(
            "{}: {} samples over {} s.",
            next.kind,
            drive.samples(),
            short(drive.time(drive.samples()))
        ),
        x: "t in s".into(),
        panels,
    };
    Some(chart.svg())
}
