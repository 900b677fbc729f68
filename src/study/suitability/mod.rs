//! Suitability of a record for a twin: faults of the record that would pass for faults of the twin, before any fit.
//!
//! | file | question |
//! |---|---|
//! | `time.rs` | is time in seconds, is the record sampled and long enough |
//! | `channels.rs` | is a channel constant, clipped, coarse, with outliers |
//! | `size.rs` | are inputs those of the plan, is a unit off by a power of ten |
//! | `swapped.rs` | are two outputs swapped |
//! | `information.rs` | how well the record can tell each parameter |
//!
//! Outputs are compared with runs of the twin under the record's own inputs, at points of the prior: what the twin does, too, is no
//! fault of the record.

mod channels;
mod information;
mod limits;
mod size;
mod swapped;
mod time;

pub(crate) use information::Knowable;

use super::{Study, StudyError};
use crate::likelihood::{measured, time_constants};
use crate::math::three_digits;
use crate::progress::Progress;
use crate::record::{Drive, Quantity, Record, Signal};
use crate::setting::{count, number, unit_suffix};
use crate::twin::Noise;
use crate::twin::conformance::{Finding, Severity};
use limits::LIMITS;

/// Findings about a record and a twin.
#[derive(Debug)]
pub(crate) struct Suitability {
    /// Results of the checks, those that passed too.
    pub findings: Vec<Finding>,
    /// Expected errors of the parameters; empty where they cannot be told.
    pub parameters: Vec<Knowable>,
}

impl Study {
    /// Checks whether a record suits this study's twin: units of time and channels, sampling, swapped or damaged channels, inputs
    /// outside the plan, and parameters that the record cannot tell. A finding that is no pass names the remedy.
    ///
    /// # Errors
    ///
    /// [`StudyError`]: a plan whose input file cannot be read, cancellation.
    pub fn check_suitability(
        &self,
        record: &Record,
        seed: u64,
        progress: &Progress,
    ) -> Result<Vec<Finding>, StudyError> {
        Ok(self.suitability(record, seed, progress)?.findings)
    }

    /// As [`check_suitability`](Self::check_suitability), with the expected errors of the parameters.
    pub(crate) fn suitability(
        &self,
        record: &Record,
        seed: u64,
        progress: &Progress,
    ) -> Result<Suitability, StudyError> {
        let noise = Noise::new(seed, "suitability", 0);
        if let Err(error) = record.check_channels(&self.twin.signals()) {
            let problem = error.of_twin(&self.name).to_string();
            return Ok(Suitability {
                findings: vec![Finding::failure("channels", problem)],
                parameters: vec![],
            });
        }
        let mut findings = described(record, &self.twin.signals().outputs);
        findings.extend(time::events(self, record));
        // A channel may have no value at the beginning; the whole record has one.
        let begin = record.first_part(record.samples().min(LIMITS.looked_at));
        let record = begin.unwrap_or_else(|| record.clone());
        let stage = progress.stage("runs", LIMITS.draws as usize + 4);
        // A plan without inputs is no fault of the record.
        let drives = self.drives().ok();
        let drawn = |noise| drives.as_ref()?.draw(noise).ok();
        let planned = drawn(noise).and_then(|drive| self.planned(drive, noise));
        let planned_drive = planned.as_ref().map(Record::drive);
        stage.tick()?;
        let constants = planned.as_ref().and_then(|r| self.time_constants(r));
        let (found, unit) = time::check(self, &record, constants);
        findings.extend(found);
        let again = |draw| drawn(noise.child("plan").sample(draw));
        let (found, factors) = size::check_inputs(self, &record, planned_drive, again);
        findings.extend(found);
        // Further checks are not to repeat what is known: they see the record in the right units.
        let record = size::with_inputs_divided(time::in_seconds(record, unit)?, &factors)?;
        // With noise, at the centre of the prior and at draws of it; those that diverge are left out.
        let mut runs = vec![];
        let space = self.twin.parameters();
        for draw in 0..=LIMITS.draws {
            let noise = noise.sample(draw);
            let theta = match draw {
                0 => space.centre(),
                _ => space.draw_prior(noise),
            };
            let run = self.twin.simulate(&theta, record.drive(), noise);
            stage.tick()?;
            match run {
                // At a draw, the fault may be that of an unusual θ.
                Err(error) if draw == 0 && !error.costs_one_run() => {
                    findings.push(Finding::failure("scale", error.to_string()));
                    return Ok(Suitability {
                        findings,
                        parameters: vec![],
                    });
                }
                run => runs.extend(run.ok().filter(|run| run.iter().all(|v| v.is_finite()))),
            }
        }
        findings.extend(channels::check(self, &record, planned_drive, &runs));
        let (found, order) = swapped::check(self, &record, &runs);
        findings.extend(found);
        let record = swapped::in_order(&record, &order)?;
        let (found, factors) = size::check_outputs(self, &record, &runs);
        findings.extend(found);
        let record = size::with_outputs_divided(record, &factors)?;
        stage.tick()?;
        let (finding, parameters) = information::check(self, &record, planned.as_ref());
        findings.push(finding);
        stage.tick()?;
        Ok(Suitability {
            findings,
            parameters,
        })
    }

    /// Returns what shows that a record's times are in another unit than seconds.
    pub(crate) fn mistaken_time(&self, record: &Record, seed: u64) -> Option<String> {
        let noise = Noise::new(seed, "suitability", 0);
        let constants = || {
            let drive = self.drives().ok()?.draw(noise).ok()?;
            self.time_constants(&self.planned(drive, noise)?)
        };
        let drive = record.drive().first(LIMITS.looked_at);
        let (_, shown) = time::mistaken_unit(self, &drive, constants)?;
        Some(shown)
    }

    /// A record as the plan has them, simulated at the centre of the prior.
    fn planned(&self, drive: Drive, noise: Noise) -> Option<Record> {
        let drive = drive.first(LIMITS.looked_at);
        let theta = self.twin.parameters().centre();
        let outputs = self.twin.simulate(&theta, &drive, noise).ok()?;
        Record::complete(drive, outputs).ok()
    }

    /// Fastest and slowest time constant along a planned record.
    fn time_constants(&self, planned: &Record) -> Option<(f64, f64)> {
        let records = std::slice::from_ref(planned);
        let measured = measured(&self.twin, records, &self.beliefs()).ok()?;
        let problem = crate::fit::problem::Problem::of_measured(&measured, records);
        let theta = problem.centre();
        let (_, states) = problem.states(&theta).ok()?.pop()?;
        time_constants(&measured.twin, &theta, planned.drive(), &states)
    }
}

/// Length, step and gaps of a record.
fn described(record: &Record, outputs: &[Quantity]) -> Vec<Finding> {
    let drive = record.drive();
    let size = format!(
        "{}, {}, {} at {} s",
        count(drive.inputs().ncols(), "input"),
        count(record.outputs().ncols(), "output"),
        count(record.samples(), "sample"),
        text(drive.dt())
    );
    let mut findings = vec![Finding::pass("channels", size)];
    let absent = |(j, _): &(usize, _)| !record.has_output(*j);
    let absent: Vec<&str> = (outputs.iter().enumerate().filter(absent))
        .map(|(_, output)| output.name.as_str())
        .collect();
    if !absent.is_empty() {
        let message = format!(
            "no value of {}: fits and diagnoses need another record that has it",
            absent.join(", ")
        );
        findings.push(Finding::pass("sensors", message));
    }
    if drive.replicates() > 0 {
        let message = format!(
            "{} with the time of the row before: fits and diagnoses take such rows as readings of one state; an estimate needs one row a time",
            count(drive.replicates(), "row")
        );
        findings.push(Finding::pass("replicates", message));
    }
    if !record.is_complete() {
        let message = format!(
            "{} missing: fits and diagnoses leave out what is missing; an estimate needs the record resampled",
            count(record.missing(), "output value")
        );
        findings.push(Finding::pass("gaps", message));
    }
    findings
}

/// The findings, or one that says that there are none.
fn or_pass(findings: Vec<Finding>, check: &'static str, message: &str) -> Vec<Finding> {
    match findings.is_empty() {
        true => vec![Finding::pass(check, message)],
        false => findings,
    }
}

/// A number to three digits.
fn text(value: f64) -> String {
    number(three_digits(value))
}

/// A number to three digits with its unit.
fn with_unit(value: f64, unit: &str) -> String {
    text(value) + &unit_suffix(unit)
}

/// Values of a channel that are not missing, with their samples.
fn present(signal: &Signal, channel: usize) -> (Vec<usize>, Vec<f64>) {
    let column = signal.column(channel);
    let values = column.iter().copied().enumerate();
    values.filter(|(_, value)| value.is_finite()).unzip()
}

impl Suitability {
    /// Returns `true` if every check passed.
    pub fn suits(&self) -> bool {
        (self.findings.iter()).all(|finding| finding.severity == Severity::Pass)
    }
}
