//! Settings of training and refinement.

use crate::estimator::gate::{GateForm, GateSettings};
use crate::estimator::refine::RefineSettings;
use crate::estimator::sample::CloudSampler;
use crate::network::Training;
use crate::setting::SettingError;
use serde::{Deserialize, Serialize};

/// Largest bank.
const MOST_SIMULATIONS: usize = 1_000_000_000_000;

/// The cloud of fresh simulations around θ_GN.
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

impl CloudSettings {
    /// M_FT for `parameters` parameters.
    pub fn draws(&self, parameters: usize) -> usize {
        self.size.min(self.per_parameter.saturating_mul(parameters))
    }
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
                schedule: crate::network::Schedule::Cosine,
                patience: 0,
                ..Training::default()
            },
            gate: GateSettings::default(),
            refine: RefineSettings::default(),
            cloud: CloudSettings::default(),
            tuning: Training {
                epochs: 15,
                schedule: crate::network::Schedule::Cosine,
                weight_decay: 5e-5,
                patience: 0,
                ..Training::default()
            },
        }
    }
}

impl Settings {
    /// Returns the settings of the paper and its code for every twin: K = 150 for the gate in its own form, three seeds, eight
    /// starts, the hybrid sampler, early stop on a fifth of the cloud.
    ///
    /// γ, λ and epochs differ between the paper's twins; here stand the oscillator's, in units of a prior of width 1.
    pub fn paper() -> Self {
        Self {
            bank_size: 10_000,
            inputs: Inputs::Each,
            training: Training {
                epochs: 200,
                holdout: 0.0,
                patience: 0,
                ..Training::default()
            },
            gate: GateSettings {
                form: GateForm::Paper,
                ..GateSettings::default()
            },
            refine: RefineSettings {
                seeds: 3,
                survey_seeds: 3,
                pull: 1e-3,
                ridge: 1e-3,
                ..RefineSettings::default()
            },
            cloud: CloudSettings {
                size: 1000,
                per_parameter: 1000,
                sampler: CloudSampler::Hybrid,
                spread: 1.0,
                rescale: false,
                quadratic: false,
            },
            tuning: Training {
                epochs: 200,
                weight_decay: 5e-5,
                holdout: 0.2,
                patience: 20,
                ..Training::default()
            },
        }
    }

    /// Checks whether each number is in its range.
    pub fn check(&self) -> Result<(), SettingError> {
        self.training.check()?;
        self.tuning.check()?;
        self.gate.check()?;
        self.refine.check()?;
        let refuse =
            |field: &str, value: f64, remedy: &str| Err(SettingError::new(field, value, remedy));
        if self.bank_size < 100 {
            let value = self.bank_size as f64;
            return refuse("bank size", value, "train on at least 100 simulations");
        }
        if self.bank_size > MOST_SIMULATIONS {
            let value = self.bank_size as f64;
            return refuse("bank size", value, "at most 10¹² simulations are taken");
        }
        for (field, value) in [
            ("cloud size", self.cloud.size),
            ("cloud per_parameter", self.cloud.per_parameter),
        ] {
            if value < 10 {
                return refuse(field, value as f64, "take at least 10 simulations");
            }
        }
        if !(self.cloud.spread > 0.0 && self.cloud.spread.is_finite()) {
            return refuse("cloud spread", self.cloud.spread, "must be positive");
        }
        Ok(())
    }
}
