//! Settings of a diagnosis.

use crate::effect::EffectPattern;
use crate::likelihood::Beliefs;
use crate::progress::Cancelled;
use crate::study::Study;
use crate::twin::Noise;
use serde::{Deserialize, Serialize};

/// A part of a diagnosis that can be taken out, to measure what it is worth.
///
/// ```
/// use truetwin::diagnose::{Ablation, DiagnoseSettings};
///
/// let ablated = vec![Ablation::UnknownFunctions];
/// let settings = DiagnoseSettings { ablated, ..DiagnoseSettings::default() };
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ablation {
    /// Noise levels are held as they are declared. The measurement noise of a black box stays fitted.
    FittedNoise,
    /// Listed effects have no rivals: what they leave is not looked for.
    UnknownFunctions,
    /// BIC takes the place of evidence: ll(θ̂) − ½·k·ln N, k fitted entries, N samples of all outputs.
    Evidence,
}

impl Ablation {
    /// All parts.
    pub const ALL: [Self; 3] = [Self::FittedNoise, Self::UnknownFunctions, Self::Evidence];

    /// Name of the part.
    pub fn id(self) -> &'static str {
        match self {
            Self::FittedNoise => "fitted-noise",
            Self::UnknownFunctions => "unknown-functions",
            Self::Evidence => "evidence",
        }
    }
}

/// Settings of a diagnosis.
///
/// | setting | default | range | meaning |
/// |---|---|---|---|
/// | `alpha` | 0.05 | (0, 1) | level of the test whether θ left its prior |
/// | `calibrate` | 0 | | records of the fitted twin that are simulated and diagnosed alike, for a p-value |
/// | `seed` | 1 | | of everything random |
/// | `without` | none | ids, or `id@target` | effects that are not to be named |
/// | `initial` | none | | θ that an estimator gave, a start of the fit |
/// | `detection_only` | no | | stop after the verdict: neither where, nor which, nor how far |
/// | `give_partial` | no | | when cancelled, give what was found instead of an error, once effects were tried one at a time |
/// | `quick` | no | | effects one at a time, from few starts; no pairs, smallest visible effects or next input |
/// | `ablated` | none | | parts taken out, to measure what they are worth |
#[derive(Debug, Clone, PartialEq)]
pub struct DiagnoseSettings {
    /// Level of the test whether θ left its prior.
    pub alpha: f64,
    /// Records of the fitted twin that are simulated and diagnosed alike, for a p-value.
    pub calibrate: usize,
    /// Seed of everything random.
    pub seed: u64,
    /// Effects that are not to be named: `id` or `id@target`.
    pub without: Vec<EffectPattern>,
    /// θ from an estimator.
    pub initial: Option<Vec<f64>>,
    /// Stop after the verdict.
    pub detection_only: bool,
    /// Try effects one at a time, from few starts.
    pub quick: bool,
    /// When cancelled, give what was found instead of an error, once effects were tried one at a time.
    pub give_partial: bool,
    /// Parts that are taken out, to measure what they are worth.
    pub ablated: Vec<Ablation>,
}

impl DiagnoseSettings {
    /// Source of everything random.
    pub(in crate::diagnose) fn noise(&self) -> Noise {
        Noise::new(self.seed, "diagnose", 0)
    }

    /// Returns true if a part is taken out.
    pub(in crate::diagnose) fn lacks(&self, part: Ablation) -> bool {
        self.ablated.contains(&part)
    }

    /// Passes a unit of work on; returns true if the work was cancelled and ends with what was found.
    pub(in crate::diagnose) fn ends(&self, tick: Result<(), Cancelled>) -> Result<bool, Cancelled> {
        match tick {
            Err(Cancelled) if self.give_partial => Ok(true),
            other => other.map(|()| false),
        }
    }

    /// The study's word on noise and starts; levels that are not fitted are known.
    pub(in crate::diagnose) fn beliefs(&self, study: &Study) -> Beliefs {
        let mut beliefs = study.beliefs();
        if self.lacks(Ablation::FittedNoise)
            && let Some(outline) = study.twin().outline()
        {
            let all = outline.states.iter().chain(&outline.outputs);
            beliefs.known.extend(all.map(|signal| signal.name.clone()));
        }
        beliefs
    }
}

impl Default for DiagnoseSettings {
    fn default() -> Self {
        Self {
            alpha: 0.05,
            calibrate: 0,
            seed: 1,
            without: vec![],
            initial: None,
            detection_only: false,
            quick: false,
            give_partial: false,
            ablated: vec![],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::diagnose;
    use crate::diagnose::fixture::{biased_record, only, tanks};
    use crate::progress::Progress;

    /// Each part has its say in the evidence for a gap.
    #[test]
    fn every_part_that_is_taken_out_changes_what_is_said() {
        let study = tanks(60);
        let records = [biased_record(&study, 2.0, 5)];
        let said = |ablated: Vec<Ablation>| {
            let settings = DiagnoseSettings {
                detection_only: true,
                quick: true,
                ablated,
                ..only(&study, &["sensor-bias", "sensor-gain"])
            };
            let found = diagnose(&study, &records, None, &settings, &Progress::silent());
            found.unwrap().detection.log_evidence
        };
        let whole = said(vec![]);
        for part in Ablation::ALL {
            assert_ne!(said(vec![part]), whole, "{}", part.id());
        }
    }
}
