//! Settings of training and refinement.

use crate::estimator::cloud::CloudSettings;
use crate::estimator::gate::GateSettings;
use crate::estimator::refine::RefineSettings;
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
        let size = self.bank_size;
        SettingError::unless(
            size >= 100,
            "bank size",
            size,
            "train on at least 100 simulations",
        )?;
        let remedy = "at most 10¹² simulations are taken";
        SettingError::unless(size <= MOST_SIMULATIONS, "bank size", size, remedy)?;
        for (field, count) in [
            ("cloud size", self.cloud.size),
            ("cloud per_parameter", self.cloud.per_parameter),
        ] {
            SettingError::unless(count >= 10, field, count, "take at least 10 simulations")?;
        }
        let spread = self.cloud.spread;
        let valid = spread > 0.0 && spread.is_finite();
        SettingError::unless(valid, "cloud spread", spread, "must be positive")
    }
}
