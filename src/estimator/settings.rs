//! Settings of training and refinement.

use crate::estimator::budget::BUDGET;
use crate::network::{Schedule, Training};
use crate::setting::SettingError;
use serde::{Deserialize, Serialize};

/// Most simulations of a bank.
pub(super) const MOST_SIMULATIONS: usize = 1_000_000_000_000;

/// Map from features to network inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Inputs {
    /// Each to unit deviation, as in the paper.
    Each,
    /// To unit covariance along the principal axes of the bank, limited to six standard deviations.
    #[default]
    Principal,
}

/// Every number of the method.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Simulations to train on, m.
    pub bank_size: usize,
    /// Map from features to network inputs.
    pub inputs: Inputs,
    /// Training of trunk and heads.
    pub training: Training,
    /// The out-of-distribution test.
    pub gate: GateSettings,
    /// Gauss–Newton on the features.
    pub refine: RefineSettings,
    /// The cloud.
    pub cloud: CloudSettings,
    /// Tuning of the heads.
    pub tuning: Training,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            bank_size: 10_000,
            inputs: Inputs::Principal,
            training: Training {
                epochs: 100,
                batch: 128,
                schedule: Schedule::Cosine,
                patience: 0,
                ..Training::default()
            },
            gate: GateSettings::default(),
            refine: RefineSettings::default(),
            cloud: CloudSettings::default(),
            tuning: Training {
                epochs: 15,
                schedule: Schedule::Cosine,
                weight_decay: 5e-5,
                patience: 0,
                ..Training::default()
            },
        }
    }
}

impl Settings {
    /// Checks whether each number is in its range.
    pub fn check(&self) -> Result<(), SettingError> {
        self.training.check()?;
        self.tuning.check()?;
        self.gate.check()?;
        self.refine.check()?;
        let (unless, size) = (SettingError::unless, self.bank_size);
        let remedy = "train on at least 100 simulations";
        unless(size >= 100, "bank size", size, remedy)?;
        let remedy = "at most 10¹² simulations are taken";
        unless(size <= MOST_SIMULATIONS, "bank size", size, remedy)?;
        for (field, count) in [
            ("cloud size", self.cloud.size),
            ("cloud per_parameter", self.cloud.per_parameter),
        ] {
            unless(count >= 10, field, count, "take at least 10 simulations")?;
        }
        let spread = self.cloud.spread;
        let valid = spread > 0.0 && spread.is_finite();
        SettingError::unless(valid, "cloud spread", spread, "must be positive")
    }
}

/// Which form of the test.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum GateForm {
    /// Rank among fresh simulations: exact for any number of features.
    #[default]
    Calibrated,
    /// As printed: threshold from the simulations that μ and S were estimated from, S + ε I.
    Paper,
}

/// Settings of the test.
///
/// | field | default | range | meaning |
/// |---|---|---|---|
/// | `form` | calibrated | | see [`GateForm`] |
/// | `alpha` | 0.10 | (0, 1) | rejection rate when θ is right |
/// | `simulations` | 150 | ≥ 2 | for μ and S; the calibrated form takes at least `per_feature` a feature |
/// | `per_feature` | 16 | ≥ 2 | simulations a feature for μ and S; calibrated only |
/// | `null` | 199 | ≥ 1/α − 1 | fresh simulations to rank among; calibrated only |
/// | `epsilon` | 1e-8 | > 0 | added to S, in squared feature units; paper's form only |
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GateSettings {
    /// Form of the test.
    pub form: GateForm,
    /// Rejection rate when θ is right.
    pub alpha: f64,
    /// Simulations for mean and covariance.
    pub simulations: usize,
    /// Least number of simulations a feature, calibrated form.
    pub per_feature: usize,
    /// Fresh simulations to rank among, calibrated form.
    pub null: usize,
    /// Added to the diagonal of S, paper's form.
    pub epsilon: f64,
}

impl Default for GateSettings {
    fn default() -> Self {
        Self {
            form: GateForm::Calibrated,
            alpha: 0.10,
            simulations: 150,
            per_feature: 16,
            null: 199,
            epsilon: 1e-8,
        }
    }
}

impl GateSettings {
    /// Checks whether each field is in its range.
    pub fn check(&self) -> Result<(), SettingError> {
        let unless = |valid: bool, field: &str, value: f64, remedy: &str| {
            SettingError::unless(valid, format!("gate: {field}"), value, remedy)
        };
        let alpha = self.alpha;
        let valid = alpha > 0.0 && alpha < 1.0;
        unless(valid, "alpha", alpha, "choose a rate between 0 and 1")?;
        for (field, count) in [
            ("simulations", self.simulations),
            ("per_feature", self.per_feature),
        ] {
            unless(count >= 2, field, count as f64, "at least 2 are needed")?;
        }
        let null = self.null as f64;
        let remedy = "take at least 1/alpha - 1, or p can never fall below alpha";
        unless(null >= 1.0 / alpha - 1.0, "null", null, remedy)?;
        let valid = self.epsilon > 0.0 && self.epsilon.is_finite();
        unless(valid, "epsilon", self.epsilon, "must be positive")
    }

    /// Simulations for μ and S of n features.
    pub fn whitening_simulations(&self, n: usize) -> usize {
        match self.form {
            GateForm::Calibrated => self.simulations.max(self.per_feature * n),
            GateForm::Paper => self.simulations,
        }
    }

    /// The settings of a test that is four times as large.
    pub(super) fn larger(&self) -> Self {
        Self {
            simulations: BUDGET.larger_test * self.simulations,
            per_feature: BUDGET.larger_test * self.per_feature,
            null: BUDGET.larger_test * (self.null + 1) - 1,
            ..self.clone()
        }
    }
}

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

impl RefineSettings {
    /// For features centred on the record: θ starts near its end, and the features are few.
    pub fn centred(&self) -> Self {
        Self {
            starts: 1,
            rounds: 1,
            iterations: self.iterations.min(BUDGET.centred_iterations),
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
        let not_negative = |value: f64| value >= 0.0 && value.is_finite();
        let widths = "must lie between 0 and 1 prior widths";
        for (field, value, valid, remedy) in [
            (
                "pull",
                self.pull,
                not_negative(self.pull),
                "must be 0 or more",
            ),
            (
                "ridge",
                self.ridge,
                not_negative(self.ridge),
                "must be 0 or more",
            ),
            (
                "step",
                self.step,
                self.step > 0.0 && self.step < 1.0,
                widths,
            ),
            (
                "cutoff",
                self.cutoff,
                (0.0..1.0).contains(&self.cutoff),
                "must lie in [0, 1)",
            ),
        ] {
            unless(valid, field, value, remedy)?;
        }
        Ok(())
    }
}

/// Settings of the cloud.
///
/// | field | default | range | meaning |
/// |---|---|---|---|
/// | `size` | 1000 | ≥ 10 | simulations M_FT, at most |
/// | `per_parameter` | 400 | ≥ 10 | simulations for each parameter, if that is fewer; not in the paper |
/// | `sampler` | ellipsoid | | see [`CloudSampler`] |
/// | `spread` | 2 | > 0 | standard deviations of the ellipsoid over those of the estimate; 1 in the paper |
/// | `quadratic` | true | | a quadratic layer beside the tuned heads; not in the paper |
/// | `rescale` | true | | standardise features and targets anew on the cloud; not in the paper |
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CloudSettings {
    /// Largest number of simulations.
    pub size: usize,
    /// Simulations for each parameter.
    pub per_parameter: usize,
    /// Where they are drawn.
    pub sampler: CloudSampler,
    /// Scale of the ellipsoid.
    pub spread: f64,
    /// `true` if features and targets are standardised anew on the cloud.
    pub rescale: bool,
    /// `true` if a quadratic layer stands beside the tuned heads.
    pub quadratic: bool,
}

impl Default for CloudSettings {
    fn default() -> Self {
        Self {
            size: 1000,
            per_parameter: 400,
            sampler: CloudSampler::Ellipsoid,
            spread: 2.0,
            rescale: true,
            quadratic: true,
        }
    }
}

impl CloudSettings {
    /// M_FT for `parameters` parameters.
    pub fn draws(&self, parameters: usize) -> usize {
        self.size.min(self.per_parameter.saturating_mul(parameters))
    }
}

/// Sampler of the cloud.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum CloudSampler {
    /// The confidence ellipsoid alone.
    #[default]
    Ellipsoid,
    /// Along sensitivities alone.
    Sensitivity,
    /// The paper's alternation of both.
    Hybrid,
    /// Uniform in the box of the principal axes, ±1.8·`spread` standard deviations: flat over the region.
    Box,
}
