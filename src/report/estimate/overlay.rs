//! The twin beside the record.

use crate::record::{Quantity, Record, Signal};
use crate::report::chart::{Chart, Panel, Series, Style};
use crate::report::digits::{short, unit_suffix};
use crate::study::Study;

/// Height of a panel of residuals over that of one of outputs.
const RESIDUAL_HEIGHT: f64 = 110.0;

/// A picture of a record and free runs of its twin: for each output the measured values with the runs over them, and
/// below what is left, record − twin. Root mean squares of that, per output, stand in the legends.
///
/// `before` is the run at the network's first estimate (`None` where it was kept), `after` the run at the calibrated
/// θ; both N × channels, as [`crate::estimator::Tracking::outputs`].
pub(crate) fn overlay_svg(
    study: &Study,
    record: &Record,
    before: Option<&Signal>,
    after: &Signal,
) -> String {
    let runs: Vec<Run<'_>> = match before {
        Some(before) => vec![
            Run("before", Style::BEFORE, before),
            Run("after", Style::AFTER, after),
        ],
        None => vec![Run("twin", Style::AFTER, after)],
    };
    let outputs = study.twin().signals().outputs;
    let panels = (outputs.iter().enumerate())
        .flat_map(|(channel, quantity)| panels(record, channel, quantity, &runs))
        .collect();
    let misfits: Vec<String> = (outputs.iter().enumerate())
        .map(|(channel, quantity)| {
            let of = |run: &Run<'_>| format!("{} {}", run.0, run.label(record, channel, quantity));
            let all: Vec<String> = runs.iter().map(of).collect();
            format!("{}: {}", quantity.name, all.join(", "))
        })
        .collect();
    let what = match before {
        Some(_) => "before and after calibration",
        None => "at the estimate",
    };
    let chart = Chart {
        title: format!("{}: record and twin", study.name()),
        description: format!(
            "Measured outputs over {} s and free runs of the twin {what}; below each, record minus twin. {}.",
            short(record.drive().time(record.samples().saturating_sub(1))),
            misfits.join("; "),
        ),
        x: "t in s".into(),
        panels,
    };
    chart.svg()
}

/// A free run: name, style, outputs.
struct Run<'a>(&'static str, Style, &'a Signal);

impl Run<'_> {
    /// Times with record − run.
    fn residual(&self, record: &Record, channel: usize) -> Vec<(f64, f64)> {
        let (measured, run) = (record.outputs().column(channel), self.2.column(channel));
        (measured.iter().zip(run).enumerate())
            .map(|(k, (y, f))| (record.drive().time(k), y - f))
            .collect()
    }

    /// Its misfit in words.
    fn label(&self, record: &Record, channel: usize, quantity: &Quantity) -> String {
        let residual = self.residual(record, channel);
        let squares: f64 = residual.iter().map(|(_, r)| r * r).sum();
        let rmse = (squares / residual.len().max(1) as f64).sqrt();
        format!("RMSE {}{}", short(rmse), unit_suffix(&quantity.unit))
    }
}

/// Outputs and residuals of one channel.
fn panels(record: &Record, channel: usize, quantity: &Quantity, runs: &[Run<'_>]) -> [Panel; 2] {
    let unit = match unit_suffix(&quantity.unit) {
        unit if unit.is_empty() => unit,
        unit => format!(" in{unit}"),
    };
    let timed = |values: &Signal| -> Vec<(f64, f64)> {
        (values.column(channel).iter().enumerate())
            .map(|(k, &value)| (record.drive().time(k), value))
            .collect()
    };
    let mut over = vec![Series::new(
        "measured",
        Style::RECORD,
        timed(record.outputs()),
    )];
    let mut left = vec![];
    for run in runs {
        let label = format!("{}, {}", run.0, run.label(record, channel, quantity));
        over.push(Series::new(&label, run.1, timed(run.2)));
        left.push(Series::new(run.0, run.1, run.residual(record, channel)));
    }
    [
        Panel::new(&format!("{}{unit}", quantity.name), over),
        Panel::new(&format!("{}: record − twin{unit}", quantity.name), left)
            .height(RESIDUAL_HEIGHT),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Drive, Signals};
    use crate::report::fixture::estimates;
    use crate::study::RecordPlan;
    use crate::twin::{DigitalTwin, Noise, Parameter, ParameterSpace, SimulationError};

    #[test]
    fn before_and_after_are_told_apart_with_their_errors() {
        let found = estimates();
        let (before, after) = (
            found.refined.refit().unwrap().tracking_initial.as_ref(),
            found.refined.tracking.as_ref().unwrap(),
        );
        let svg = overlay_svg(
            &found.study,
            &found.record,
            before.map(|b| &b.outputs),
            &after.outputs,
        );
        let expected = format!("after, RMSE {}<", short(after.rmse));
        assert!(svg.contains(&expected), "{expected}");
        assert!(svg.contains("before, RMSE") && svg.contains(Style::BEFORE.dash));
        let svg = overlay_svg(&found.study, &found.record, None, &after.outputs);
        assert!(svg.contains("twin, RMSE") && !svg.contains(Style::BEFORE.colour));
    }

    struct TwoSensors;
    impl DigitalTwin for TwoSensors {
        fn parameters(&self) -> ParameterSpace {
            ParameterSpace::new([Parameter::new("a", "", 0.0, 1.0)])
        }
        fn signals(&self) -> Signals {
            Signals {
                inputs: vec![],
                outputs: vec![Quantity::new("level", "m"), Quantity::new("flow", "-")],
            }
        }
        fn simulate(&self, _: &[f64], drive: &Drive, _: Noise) -> Result<Signal, SimulationError> {
            Ok(Signal::zeros((drive.samples(), 2)))
        }
    }

    #[test]
    fn every_output_has_its_panels_and_its_error() {
        let study = Study::new("pair", TwoSensors, RecordPlan::autonomous(0.1, 4)).unwrap();
        let mut outputs = Signal::zeros((4, 2));
        outputs.column_mut(1).fill(0.5);
        let record = Record::new(Drive::autonomous(0.1, 4).unwrap(), outputs).unwrap();
        let svg = overlay_svg(&study, &record, None, &Signal::zeros((4, 2)));
        for expected in [
            "level in m",
            "level: record − twin in m",
            "flow: record − twin<",
            "twin, RMSE 0.00 m",
            "twin, RMSE 0.500<",
        ] {
            assert!(svg.contains(expected), "{expected}");
        }
    }
}
