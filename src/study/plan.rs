//! Plan of simulated records: step, length, input.

use crate::math::{ends, six_digits};
use crate::record::{Drive, MOST_SAMPLES, Record, RecordError, Signal, Signals};
use crate::storage::untrusted::MOST_NUMBERS;
use crate::study::error::StudyError;
use crate::twin::{Interval, Noise};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Stretches of constant input in a record that is like a measured one.
const HOLDS: usize = 15;

/// Where the inputs of simulated records come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected { levels = [low, high], hold = n } with low < high, or the name of a CSV file"
)]
#[non_exhaustive]
pub enum InputPlan {
    /// Each input an independent staircase: levels uniform in `levels`, each held for `hold` samples; fresh for each record.
    Levels(Levels),
    /// The inputs of a file, for every record; its step and length are the study's.
    File(PathBuf),
}

/// A staircase of random levels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Levels {
    /// Range of the levels.
    pub levels: Interval,
    /// Samples that a level is held.
    pub hold: usize,
}

/// Step, length and input of simulated records.
///
/// ```
/// use truetwin::study::RecordPlan;
///
/// let with_input = RecordPlan::levels(0.1, 300, 0.0, 1.0, 20); // levels in [0, 1], each for 20 samples
/// let without = RecordPlan::autonomous(0.1, 300);
/// assert_eq!((with_input.samples, without.step), (300, 0.1));
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct RecordPlan {
    /// Step Δt in seconds.
    pub step: f64,
    /// Samples N.
    pub samples: usize,
    /// Inputs; `None` for a twin without.
    pub(crate) input: Option<InputPlan>,
    /// Time of the first row, in seconds.
    pub(crate) first_time: f64,
}

impl RecordPlan {
    /// A record without inputs, its first row at 0 s.
    pub fn autonomous(step: f64, samples: usize) -> Self {
        Self {
            step,
            samples,
            input: None,
            first_time: 0.0,
        }
    }

    /// A record under random levels in `[low, high]`, each held for `hold` samples.
    pub fn levels(step: f64, samples: usize, low: f64, high: f64, hold: usize) -> Self {
        let levels = Interval::unchecked(low, high);
        Self {
            step,
            samples,
            input: Some(InputPlan::Levels(Levels { levels, hold })),
            first_time: 0.0,
        }
    }

    /// A record like a measured one: its times, levels in the range of its inputs.
    pub(super) fn like(record: &Record) -> Self {
        let drive = record.drive();
        let (step, samples) = (drive.dt(), record.samples());
        let inputs: Vec<f64> = drive.inputs().iter().copied().collect();
        let plan = match inputs.is_empty() {
            true => Self::autonomous(step, samples),
            false => {
                let (low, high) = ends(&inputs);
                Self::levels(step, samples, low, high, (samples / HOLDS).max(1))
            }
        };
        Self {
            first_time: drive.first_time(),
            ..plan
        }
    }

    /// Checks step, length and levels; a file of inputs is not read.
    pub(super) fn check(&self, signals: &Signals) -> Result<(), StudyError> {
        let channels = signals.inputs.len();
        let all = channels + signals.outputs.len();
        let samples = self.samples;
        let levels = match &self.input {
            _ if samples > MOST_SAMPLES => Err(format!(
                "samples = {samples}; at most {MOST_SAMPLES} can be simulated: take a larger step or a shorter record"
            )),
            _ if samples.saturating_mul(all) > MOST_NUMBERS => Err(format!(
                "samples = {samples} for {all} inputs and outputs; at most {MOST_NUMBERS} numbers can be simulated: take a shorter record"
            )),
            Some(_) if channels == 0 => {
                Err("input is given, but the twin has none; remove it".into())
            }
            Some(InputPlan::Levels(Levels { hold: 0, .. })) => {
                Err("hold = 0; a level is held for at least 1 sample".into())
            }
            Some(InputPlan::Levels(Levels { levels, .. })) => Ok([levels.low(), levels.high()]),
            Some(InputPlan::File(_)) | None => Ok([0.0; 2]),
        };
        let levels = levels.map_err(StudyError::Plan)?;
        // The ends of the levels, one after the other, are what any drive is drawn between.
        let ends = Signal::from_shape_fn((samples.min(2), 1), |(k, _)| levels[k]);
        Drive::new(self.step, ends)?;
        Ok(())
    }

    /// Draws the input of a record of a twin with these channels; a fixed one is the same for any noise.
    pub fn drive(&self, signals: &Signals, noise: Noise) -> Result<Drive, StudyError> {
        Ok(self.prepare(signals)?.draw(noise)?)
    }

    /// Makes ready what drives are drawn from; reads the input file, if one is named.
    pub(crate) fn prepare(&self, signals: &Signals) -> Result<DriveSource, StudyError> {
        self.check(signals)?;
        let channels = signals.inputs.len();
        let fixed = match &self.input {
            None if channels == 0 => {
                let drive = Drive::autonomous(self.step, self.samples)?;
                Some(drive.beginning_at(self.first_time))
            }
            None => return Err(StudyError::NoInput(channels)),
            Some(InputPlan::File(path)) => Some(read(path, channels)?),
            Some(InputPlan::Levels(_)) => None,
        };
        Ok(DriveSource {
            plan: self.clone(),
            channels,
            fixed,
        })
    }

    /// Checks whether a record has the study's step, to 1e-3 of it.
    pub fn check_step(&self, record: &Record) -> Result<(), StudyError> {
        let (given, expected) = (record.drive().dt(), self.step);
        if (given - expected).abs() > 1e-3 * expected {
            return Err(StudyError::OtherStep {
                given: six_digits(given),
                expected,
            });
        }
        Ok(())
    }
}

/// Reads a file of inputs, one step and so many channels.
fn read(path: &Path, channels: usize) -> Result<Drive, StudyError> {
    let drive = Drive::read(path)?;
    let given = drive.inputs().ncols();
    let problem = match drive.is_uniform() {
        true if given == channels => return Ok(drive),
        true => format!(": {given} inputs, the twin has {channels}; give each its column"),
        false => ", column t: the steps vary; simulated records need one step: resample the inputs"
            .into(),
    };
    Err(StudyError::Plan(format!("{}{problem}", path.display())))
}

/// Draws the inputs of simulated records.
#[derive(Debug, Clone)]
pub struct DriveSource {
    plan: RecordPlan,
    channels: usize,
    fixed: Option<Drive>,
}

impl DriveSource {
    /// The drive of one record; random levels come from the noise sources `input/1`, `input/2`, ….
    pub fn draw(&self, noise: Noise) -> Result<Drive, RecordError> {
        if let Some(drive) = &self.fixed {
            return Ok(drive.clone());
        }
        let mut inputs = Signal::zeros((self.plan.samples, self.channels));
        if let Some(InputPlan::Levels(Levels { levels, hold })) = &self.plan.input {
            for (j, mut channel) in inputs.columns_mut().into_iter().enumerate() {
                let mut source = noise.source(&format!("input/{}", j + 1));
                let mut level = 0.0;
                for (k, value) in channel.iter_mut().enumerate() {
                    if k % hold == 0 {
                        level = levels.low() + levels.width() * source.uniform();
                    }
                    *value = level;
                }
            }
        }
        Ok(Drive::new(self.plan.step, inputs)?.beginning_at(self.plan.first_time))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_held_and_fresh_for_each_record() {
        let plan = RecordPlan::levels(0.5, 100, 0.0, 3.0, 30);
        let source = plan.prepare(&Signals::default()).unwrap();
        let a = source.draw(Noise::new(1, "t", 0)).unwrap();
        let b = source.draw(Noise::new(1, "t", 1)).unwrap();
        assert_ne!(a, b);
        for drive in [&a, &b] {
            let u: Vec<f64> = drive.inputs().iter().copied().collect();
            assert!(u.iter().all(|v| (0.0..3.0).contains(v)));
            assert!((1..100).all(|k| (u[k] != u[k - 1]) == (k % 30 == 0)));
        }
    }

    #[test]
    fn what_is_missing_is_named() {
        let error = RecordPlan::autonomous(0.5, 9).prepare(&Signals::default());
        assert!(error.unwrap_err().to_string().contains("1 inputs"));
        let plan = RecordPlan::levels(0.5, 9, 0.0, 1.0, 0);
        assert!(matches!(
            plan.prepare(&Signals::default()),
            Err(StudyError::Plan(_))
        ));
    }
}
