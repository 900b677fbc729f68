//! Conditions of a record that are no gap of the twin: noise, start, feedback, missing samples.

use crate::evaluate::trials::numbers::TRIAL;
use crate::record::Signal;
use crate::twin::{Hold, Noise, Source};
use serde::{Deserialize, Serialize};

/// Condition of a record that its twin does not describe, and that is no gap of it. Sizes are in docs/withheld.md.
///
/// ```
/// use truetwin::evaluate::trials::{NuisanceKind, TrialSettings};
///
/// // Each record has one of these; without a choice, half of the records have one of all.
/// let nuisances = vec![NuisanceKind::OperatingPoint, NuisanceKind::SampledInput];
/// let settings = TrialSettings { nuisances, ..TrialSettings::default() };
/// assert_eq!(settings.nuisances[0].id(), "operating-point");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum NuisanceKind {
    /// Everything as declared.
    None,
    /// Noise levels other than those declared.
    Level,
    /// Autoregressive noise.
    Coloured,
    /// Noise with Student's t distribution.
    HeavyTailed,
    /// Measurement noise that grows with the signal.
    ProportionalNoise,
    /// Another first state.
    Start,
    /// The record begins in the middle of a run.
    OperatingPoint,
    /// Inputs that depend on the outputs.
    ClosedLoop,
    /// Inputs that move between the samples.
    SampledInput,
    /// Missing samples.
    Gaps,
}

impl NuisanceKind {
    /// All, in the order of tables.
    pub const ALL: [Self; 10] = [
        Self::None,
        Self::Level,
        Self::Coloured,
        Self::HeavyTailed,
        Self::ProportionalNoise,
        Self::Start,
        Self::OperatingPoint,
        Self::ClosedLoop,
        Self::SampledInput,
        Self::Gaps,
    ];

    /// As in calls and files.
    pub fn id(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Level => "level",
            Self::Coloured => "coloured",
            Self::HeavyTailed => "heavy-tailed",
            Self::ProportionalNoise => "proportional-noise",
            Self::Start => "start",
            Self::OperatingPoint => "operating-point",
            Self::ClosedLoop => "closed-loop",
            Self::SampledInput => "sampled-input",
            Self::Gaps => "gaps",
        }
    }
}

/// Proportional feedback from the first output to the first input.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::evaluate::trials) struct Feedback {
    pub gain: f64,
    pub setpoint: f64,
    pub low: f64,
    pub high: f64,
}

/// Conditions of one record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::evaluate::trials) struct Conditions {
    pub nuisance: NuisanceKind,
    /// Factors on the declared standard deviations.
    pub process: f64,
    pub measurement: f64,
    /// Correlation of noise from one sample to the next.
    pub colour: f64,
    /// Degrees of freedom of Student's t; none for normal noise.
    pub freedom: Option<u32>,
    /// Deviation of further measurement noise, as a share of the value that it is added to.
    #[serde(default)]
    pub proportional: f64,
    /// Shift of each state at the first sample.
    pub start: Vec<f64>,
    /// Samples for which the system has run before the first, under the last inputs of the record.
    #[serde(default)]
    pub lead: usize,
    pub feedback: Option<Feedback>,
    /// True if inputs go on a line from sample to sample, whatever the twin makes of them.
    #[serde(default)]
    pub sampled: bool,
    /// Share of samples that are missing.
    pub gaps: f64,
    /// Standard deviation of measurement noise added to each output of a twin that declares no noise.
    pub added: Vec<f64>,
}

impl Conditions {
    /// The conditions that the twin describes.
    pub fn declared() -> Self {
        Self {
            nuisance: NuisanceKind::None,
            process: 1.0,
            measurement: 1.0,
            colour: 0.0,
            freedom: None,
            proportional: 0.0,
            start: vec![],
            lead: 0,
            feedback: None,
            sampled: false,
            gaps: 0.0,
            added: vec![],
        }
    }

    /// Sources of noise of unit variance under these conditions, one a channel of `what`.
    pub(super) fn noises(&self, noise: Noise, what: &str, channels: usize) -> Vec<UnitNoise> {
        (0..channels)
            .map(|i| self.noise(noise.source(&format!("world/{what}/{i}"))))
            .collect()
    }

    fn noise(&self, source: Source) -> UnitNoise {
        UnitNoise {
            source,
            colour: self.colour,
            freedom: self.freedom,
            last: None,
        }
    }

    /// Standard deviation of the measurement noise of output `j` where its value is `y` and its declared noise `declared`.
    pub(super) fn measurement_at(&self, j: usize, y: f64, declared: f64) -> f64 {
        let level = self.measurement * declared.hypot(self.added_to(j));
        level.hypot(self.proportional * y)
    }

    /// Standard deviation of measurement noise added to output `j`.
    pub fn added_to(&self, j: usize) -> f64 {
        self.added.get(j).copied().unwrap_or(0.0)
    }

    /// Rules of inputs between samples, from those of the twin.
    pub(super) fn holds(&self, twin: &[Hold]) -> Vec<Hold> {
        let own = |hold: &Hold| match (hold, self.sampled) {
            (Hold::Zero, true) => Hold::Linear,
            _ => *hold,
        };
        twin.iter().map(own).collect()
    }

    /// Empties samples in blocks, never all of a channel.
    pub(super) fn empty(&self, outputs: &mut Signal, noise: Noise) {
        if self.gaps <= 0.0 {
            return;
        }
        let begins = self.gaps / (TRIAL.gap_length * (1.0 - self.gaps));
        for (j, mut channel) in outputs.columns_mut().into_iter().enumerate() {
            let mut source = noise.source(&format!("world/gaps/{j}"));
            let mut inside = false;
            // The first and the last few rows stay, so that a record always has a beginning.
            let last = channel.len().saturating_sub(3);
            for (k, value) in channel.iter_mut().enumerate() {
                inside = match inside {
                    true => !source.happens(1.0 / TRIAL.gap_length),
                    false => source.happens(begins),
                };
                if inside && (3..last).contains(&k) {
                    *value = f64::NAN;
                }
            }
        }
    }
}

/// Noise of unit variance, coloured or heavy-tailed.
pub(super) struct UnitNoise {
    source: Source,
    colour: f64,
    freedom: Option<u32>,
    last: Option<f64>,
}

impl UnitNoise {
    pub fn next(&mut self) -> f64 {
        let normal = self.source.normal();
        let fresh = match self.freedom {
            None => normal,
            Some(freedom) => {
                let squares: f64 = (0..freedom).map(|_| self.source.normal().powi(2)).sum();
                let freedom = f64::from(freedom);
                let scale = ((freedom - 2.0) / freedom).sqrt();
                // Noise that is off has no squares.
                if squares > 0.0 {
                    scale * normal / (squares / freedom).sqrt()
                } else {
                    0.0
                }
            }
        };
        let next = match self.last {
            None => fresh,
            Some(last) => self.colour * last + (1.0 - self.colour.powi(2)).sqrt() * fresh,
        };
        self.last = Some(next);
        next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(conditions: &Conditions) -> Vec<f64> {
        let mut noise = conditions.noise(Noise::new(1, "unit", 0).source("n"));
        (0..20_000).map(|_| noise.next()).collect()
    }

    /// Every kind of noise has unit variance; coloured noise its correlation, heavy-tailed noise its tails.
    #[test]
    fn noise_is_as_it_is_called() {
        let moment = |v: &[f64], lag: usize| -> f64 {
            v.iter().skip(lag).zip(v).map(|(a, b)| a * b).sum::<f64>() / v.len() as f64
        };
        let coloured = drawn(&Conditions {
            colour: 0.6,
            ..Conditions::declared()
        });
        assert!((moment(&coloured, 0) - 1.0).abs() < 0.1);
        assert!((moment(&coloured, 1) - 0.6).abs() < 0.06);
        let tailed = drawn(&Conditions {
            freedom: Some(5),
            ..Conditions::declared()
        });
        assert!((moment(&tailed, 0) - 1.0).abs() < 0.1);
        let far = |v: &[f64]| v.iter().filter(|v| v.abs() > 4.0).count();
        assert!(far(&tailed) > 20 && far(&coloured) < 10);
    }

    #[test]
    fn nuisances_have_one_name_in_calls_and_files() {
        for kind in NuisanceKind::ALL {
            assert_eq!(serde_json::to_value(kind).unwrap(), kind.id());
        }
    }

    #[test]
    fn gaps_take_about_their_share_and_leave_both_ends() {
        let conditions = Conditions {
            gaps: 0.15,
            ..Conditions::declared()
        };
        let mut outputs = Signal::zeros((4000, 2));
        conditions.empty(&mut outputs, Noise::new(1, "gaps", 0));
        let share = outputs.iter().filter(|v| v.is_nan()).count() as f64 / 8000.0;
        assert!((share - 0.15).abs() < 0.03, "{share}");
        assert!(!outputs[[0, 0]].is_nan() && !outputs[[3999, 1]].is_nan());
    }
}
