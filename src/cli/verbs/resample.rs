//! `resample`: puts a record on a time grid of one step.

use crate::cli::prelude::*;
use crate::cli::shell_word::shown;
use crate::math::six_digits;
use crate::record::{InputRule, Record, RecordError, Resampled, resample};
use crate::setting::{count, number};
use clap::{Args, ValueEnum};

/// Resample a record to one step: inputs averaged or held, outputs interpolated linearly, longer gaps left empty.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
        truetwin resample R.csv --step 0.5 --out R2.csv\n  \
        truetwin resample R.csv --step 0.5 --longest-gap 10 --out R2.csv\n  \
        truetwin resample log.csv --columns t=time,u=pump,y=level --step 1 --inputs hold --out R.csv\n\
        Next: truetwin check R2.csv --twin NAME")]
pub(in crate::cli) struct Resample {
    /// Measured record.
    #[arg(value_name = "R.csv")]
    record: PathBuf,
    #[command(flatten)]
    columns: FileColumns,
    /// New step in seconds.
    #[arg(long, value_name = "SECONDS")]
    step: f64,
    /// Inputs of a step: the mean of those that act during it, or the one that acts when it begins.
    #[arg(long, value_enum, default_value = "mean")]
    inputs: Inputs,
    /// Longest time between two measured outputs that is interpolated over [default: 4 steps, the old or the new ones: 3 missing
    /// samples in a row].
    #[arg(long, value_name = "SECONDS")]
    longest_gap: Option<f64>,
    /// New file of the resampled record.
    #[arg(long, value_name = "R2.csv")]
    out: PathBuf,
}

/// Rule for the inputs of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Inputs {
    /// Mean over the step.
    Mean,
    /// Held from the begin of the step.
    Hold,
}

impl Verb for Resample {
    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        records::check_new(&self.out)?;
        let (record, names) = self.columns.reader_without_twin().named(&self.record)?;
        let rule = match self.inputs {
            Inputs::Mean => InputRule::Mean,
            Inputs::Hold => InputRule::Hold,
        };
        let new = resample(&record, self.step, rule, self.longest_gap);
        let new = match new {
            Err(error @ RecordError::Step(_)) => Err(Failure::user(format!("--step: {error}"))),
            new => new.in_file(&self.record),
        }?;
        write_result(&self.out, |path| {
            Ok::<_, Failure>(new.record.write_named(path, &names)?)
        })?;
        let grid = |record: &Record| {
            let (shortest, longest) = steps(record);
            json!({
                "samples": record.samples(), "missing": record.missing(),
                "shortest_step": shortest, "longest_step": longest,
            })
        };
        let json = json!({
            "schema": "truetwin.resample/1", "record": output::name(&self.out),
            "inputs": match self.inputs { Inputs::Mean => "mean", Inputs::Hold => "hold" },
            "before": grid(&record), "after": grid(&new.record),
            "interpolated": new.interpolated, "longest_gap": new.longest_gap,
        });
        Provenance::new(context)
            .files("record", [&self.record])
            .print_beside(context, json, || self.text(&record, &new))
    }
}

impl Resample {
    fn text(&self, record: &Record, new: &Resampled) -> String {
        let mut lines = vec![
            grid_line(&shown(&self.record), record),
            grid_line(&shown(&self.out), &new.record),
        ];
        if record.drive().inputs().ncols() > 0 {
            lines.push(match self.inputs {
                Inputs::Mean => "inputs: mean over each step".into(),
                Inputs::Hold => "inputs: held from the begin of each step".into(),
            });
        }
        lines.push(format!(
            "outputs: {} interpolated, over at most {} s between measured ones",
            new.interpolated,
            short(new.longest_gap)
        ));
        if new.record.missing() > 0 {
            lines.push(format!(
                "{} left empty: in longer gaps (--longest-gap SECONDS closes them), or before the first or after the last measured output (remove these rows for `estimate`)",
                count(new.record.missing(), "output")
            ));
        }
        lines.join("\n")
    }
}

/// Returns the shortest and the longest step of a record, in seconds.
fn steps(record: &Record) -> (f64, f64) {
    let drive = record.drive();
    let steps = (1..record.samples()).map(|k| drive.step(k - 1));
    steps.fold((f64::INFINITY, 0.0), |(low, high), step| {
        (step.min(low), step.max(high))
    })
}

fn grid_line(name: &str, record: &Record) -> String {
    let (low, high) = steps(record);
    let steps = match record.drive().is_uniform() {
        true => format!("a step of {} s", short(record.drive().dt())),
        false => format!("steps of {} to {} s", short(low), short(high)),
    };
    let samples = count(record.samples(), "sample");
    let missing = count(record.missing(), "missing output");
    format!("{name}: {samples}, {steps}, {missing}")
}

/// A number to six digits.
fn short(value: f64) -> String {
    number(six_digits(value))
}
