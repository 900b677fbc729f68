//! Records with runs of a twin over them, and what is left below: the picture of every result, and the table behind it.

use super::chart::{Line, Panel, Span, Style, TimeMark, chart, roomy};
use super::digits::{in_unit, named, short, with_unit};
use crate::record::{Quantity, Record, Signal};
use crate::study::Study;

/// A run of a twin beside a record: name, style, N × outputs.
pub(super) struct Run<'a>(pub &'a str, pub Style, pub &'a Signal);

/// A record, runs over it, and marks of time.
pub(super) struct RecordPicture<'a> {
    pub title: String,
    pub outputs: &'a [Quantity],
    pub times: &'a [f64],
    pub measured: &'a Signal,
    pub runs: Vec<Run<'a>>,
    /// Stretches of time of an output.
    pub spans: &'a dyn Fn(&str) -> Vec<Span>,
    pub marks: Vec<TimeMark>,
}

impl RecordPicture<'_> {
    /// For each output the measured values with the runs over them, and below what is left, record − run. Root mean squares of that stand in
    /// the legends. Runs that leave the range of the measured values are cut off.
    pub fn svg(&self) -> String {
        let outputs = || self.outputs.iter().enumerate();
        let errors: Vec<String> = outputs()
            .map(|(j, output)| {
                if !self.has(j) {
                    return format!("{}: not measured", output.name);
                }
                let of = |run: &Run<'_>| format!("{} {}", run.0, self.rmse(run, j, output));
                let all: Vec<String> = self.runs.iter().map(of).collect();
                format!("{}: {}", output.name, all.join(", "))
            })
            .collect();
        let description = format!(
            "Measured outputs over {} s and free runs of the twin; below each, record minus twin. {}.",
            short(self.times.last().copied().unwrap_or(0.0)),
            errors.join("; "),
        );
        let panels = outputs().flat_map(|(j, output)| self.panels(j, output));
        let axis = ("t in s".to_owned(), panels.collect());
        chart(&self.title, &description, &[axis])
    }

    fn panels(&self, j: usize, output: &Quantity) -> Vec<Panel> {
        let timed = |values: &Signal| self.times.iter().copied().zip(values.column(j).to_vec());
        let shown = roomy(self.measured.column(j).iter().copied());
        let word = if self.has(j) {
            "measured"
        } else {
            "not measured"
        };
        let mut over = vec![Line::new(word, Style::RECORD, timed(self.measured))];
        let mut left = vec![];
        for run in &self.runs {
            let label = match self.has(j) {
                true => format!("{}, {}", run.0, self.rmse(run, j, output)),
                false => run.0.to_owned(),
            };
            let line = Line::new(&label, run.1, timed(run.2));
            over.push(match self.has(j) {
                true => line.within(shown.clone()),
                false => line,
            });
            let residual = self.times.iter().copied().zip(self.residual(run, j));
            left.push(Line::new("", run.1, residual));
        }
        let above = Panel::new(&named(output), over)
            .spans((self.spans)(&output.name))
            .marks(self.marks.clone());
        let label = format!("{}: record − twin{}", output.name, in_unit(&output.unit));
        match left.is_empty() || !self.has(j) {
            true => vec![above],
            false => vec![above, Panel::new(&label, left).height(90.0)],
        }
    }

    /// Returns whether the record has values of an output.
    fn has(&self, j: usize) -> bool {
        self.measured.column(j).iter().any(|v| v.is_finite())
    }

    fn residual(&self, run: &Run<'_>, j: usize) -> Vec<f64> {
        let pairs = self.measured.column(j).into_iter().zip(run.2.column(j));
        pairs.map(|(y, f)| y - f).collect()
    }

    /// Root mean square of what is left where something was measured.
    fn rmse(&self, run: &Run<'_>, j: usize, output: &Quantity) -> String {
        let mut left = self.residual(run, j);
        left.retain(|r| r.is_finite());
        let squares: f64 = left.iter().map(|r| r * r).sum();
        let rmse = (squares / left.len().max(1) as f64).sqrt();
        format!("RMSE {}", with_unit(rmse, &output.unit))
    }
}

/// A record and free runs of its twin: `before` at the network's first estimate (`None` where it was kept), `after` at the calibrated θ;
/// both N × outputs.
pub(crate) fn overlay_svg(
    study: &Study,
    record: &Record,
    before: Option<&Signal>,
    after: Option<&Signal>,
) -> String {
    let word = if before.is_some() { "after" } else { "twin" };
    let before = before.map(|run| Run("before", Style::BEFORE, run));
    let after = after.map(|run| Run(word, Style::AFTER, run));
    RecordPicture {
        title: format!("{}: record and twin", study.name()),
        outputs: &study.twin().signals().outputs,
        times: &record.drive().times(),
        measured: record.outputs(),
        runs: before.into_iter().chain(after).collect(),
        spans: &|_| vec![],
        marks: vec![],
    }
    .svg()
}

/// CSV with a row a sample: `t`, then for each output what was measured, and what the twin shows without noise before
/// (where it is given) and after calibration: `y`, `before`, `after`, numbered where there are several outputs.
pub(crate) fn trajectories_csv(record: &Record, before: Option<&Signal>, after: &Signal) -> String {
    let signals = [
        ("y", Some(record.outputs())),
        ("before", before),
        ("after", Some(after)),
    ];
    let outputs = record.outputs().ncols();
    let mut columns = vec![];
    for j in 0..outputs {
        for (word, signal) in &signals {
            let number = if outputs == 1 {
                String::new()
            } else {
                (j + 1).to_string()
            };
            columns.extend(signal.map(|signal| (format!("{word}{number}"), signal.column(j))));
        }
    }
    let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
    let mut text = format!("t,{}\n", names.join(","));
    for (k, time) in record.drive().times().into_iter().enumerate() {
        text.push_str(&format!("{time:.9}"));
        for (_, column) in &columns {
            text.push_str(&format!(",{}", column[k]));
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Drive, Signals};
    use crate::study::RecordPlan;
    use crate::twin::{DigitalTwin, Noise, Parameter, ParameterSpace, SimulationError};

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

    /// Each output has its panels and its error, which missing values do not change.
    #[test]
    fn every_output_has_its_panels_and_its_error() {
        let study = Study::new("pair", TwoSensors, RecordPlan::autonomous(0.1, 4)).unwrap();
        let mut outputs = Signal::zeros((4, 2));
        outputs.column_mut(1).fill(0.5);
        outputs[[2, 1]] = f64::NAN;
        let record = Record::new(Drive::autonomous(0.1, 4).unwrap(), outputs).unwrap();
        let run = Signal::zeros((4, 2));
        let svg = overlay_svg(&study, &record, None, Some(&run));
        for expected in [
            "level in m",
            "level: record − twin in m",
            "flow: record − twin<",
            "twin, RMSE 0.00 m",
            "twin, RMSE 0.500<",
        ] {
            assert!(svg.contains(expected), "{expected}");
        }
        let mut absent = record.outputs().clone();
        absent.column_mut(1).fill(f64::NAN);
        let absent = Record::new(record.drive().clone(), absent).unwrap();
        let svg = overlay_svg(&study, &absent, None, Some(&run));
        assert!(svg.contains("not measured") && svg.contains("twin, RMSE 0.00 m"));
        assert!(!svg.contains("flow: record − twin") && !svg.contains("NaN"));
        let both = overlay_svg(&study, &record, Some(&run), Some(&run));
        assert!(both.contains("before, RMSE") && both.contains("after, RMSE"));
    }

    #[test]
    fn one_column_a_line_of_the_picture() {
        let drive = Drive::autonomous(0.5, 2).unwrap();
        let signal = |v: f64| Signal::from_elem((2, 2), v);
        let record = Record::new(drive, signal(1.0)).unwrap();
        let text = trajectories_csv(&record, Some(&signal(2.0)), &signal(3.0));
        assert!(text.starts_with("t,y1,before1,after1,y2,before2,after2\n"));
        assert_eq!(text.lines().nth(2), Some("0.500000000,1,2,3,1,2,3"));
        assert!(trajectories_csv(&record, None, &signal(3.0)).starts_with("t,y1,after1,"));
    }
}
