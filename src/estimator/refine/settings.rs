//! The numbers of the refinement.

use crate::setting::SettingError;
use serde::{Deserialize, Serialize};

/// Settings of the refinement.
///
/// | field | default | range | meaning |
/// |---|---|---|---|
/// | `starts` | 8 | ≥ 1 | θ_init, then space-filling points in the bounds |
/// | `rounds` | 4 | ≥ 1 | times S is simulated again around the best start's end |
/// | `iterations` | 6 | ≥ 1 | Gauss–Newton iterations a round |
/// | `seeds` | 64 | ≥ 1 | runs that f̄ averages; adds 1/seeds to the feature variance |
/// | `centred_seeds` | 16 | ≥ 1 | the same about features that were centred on the record |
/// | `survey_seeds` | 8 | ≥ 1 | the same while the starts compete |
/// | `pull` | 1 | ≥ 0 | γ, θ in units of the prior's width |
/// | `ridge` | 1 | ≥ 0 | λ added to JᵀJ in G, θ in units of the prior's width |
/// | `step` | 0.01 | > 0 | finite-difference step, in prior widths |
/// | `cutoff` | 1e-3 | [0, 1) | singular values of J below this part of the largest are left out of a step |
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RefineSettings {
    /// Number of starts.
    pub starts: usize,
    /// Whitenings around the best.
    pub rounds: usize,
    /// Iterations a round.
    pub iterations: u64,
    /// Runs that f̄ averages.
    pub seeds: usize,
    /// Runs that f̄ averages about features centred on the record.
    pub centred_seeds: usize,
    /// Runs that f̄ averages while the starts compete.
    pub survey_seeds: usize,
    /// γ.
    pub pull: f64,
    /// λ.
    pub ridge: f64,
    /// Finite-difference step, in prior widths.
    pub step: f64,
    /// Relative cut-off of singular values.
    pub cutoff: f64,
}

impl Default for RefineSettings {
    fn default() -> Self {
        Self {
            starts: 8,
            rounds: 4,
            iterations: 6,
            seeds: 64,
            centred_seeds: 16,
            survey_seeds: 8,
            pull: 1.0,
            ridge: 1.0,
            step: 0.01,
            cutoff: 1e-3,
        }
    }
}

/// Iterations about features that were centred on the record.
const CENTRED_ITERATIONS: u64 = 3;

impl RefineSettings {
    /// For features centred on the record: θ starts near its end, and the features are few.
    pub fn centred(&self) -> Self {
        Self {
            starts: 1,
            rounds: 1,
            iterations: self.iterations.min(CENTRED_ITERATIONS),
            seeds: self.centred_seeds.min(self.seeds),
            ..self.clone()
        }
    }

    /// Checks whether each field is in its range.
    pub fn check(&self) -> Result<(), SettingError> {
        let unless = |valid: bool, field: &str, value: f64, remedy: &str| {
            SettingError::unless(valid, format!("refine: {field}"), value, remedy)
        };
        for (field, count) in [
            ("starts", self.starts),
            ("rounds", self.rounds),
            ("iterations", self.iterations as usize),
            ("seeds", self.seeds),
            ("centred_seeds", self.centred_seeds),
            ("survey_seeds", self.survey_seeds),
        ] {
            unless(count > 0, field, 0.0, "at least 1 is needed")?;
        }
        for (field, value) in [("pull", self.pull), ("ridge", self.ridge)] {
            let valid = value >= 0.0 && value.is_finite();
            unless(valid, field, value, "must be 0 or more")?;
        }
        let remedy = "must lie between 0 and 1 prior widths";
        unless(
            self.step > 0.0 && self.step < 1.0,
            "step",
            self.step,
            remedy,
        )?;
        let valid = (0.0..1.0).contains(&self.cutoff);
        unless(valid, "cutoff", self.cutoff, "must lie in [0, 1)")
    }
}
