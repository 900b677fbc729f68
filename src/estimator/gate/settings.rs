//! Settings of the out-of-distribution test.

use crate::estimator::error::EstimatorError;
use crate::math::Whitening;
use crate::setting::SettingError;
use ndarray::Array2;
use serde::{Deserialize, Serialize};

/// Simulations of the test of an unsure answer, over those of the first: they halve its Monte-Carlo error.
const MORE: usize = 4;

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
    pub(in crate::estimator) fn larger(&self) -> Self {
        Self {
            simulations: MORE * self.simulations,
            per_feature: MORE * self.per_feature,
            null: MORE * (self.null + 1) - 1,
            ..self.clone()
        }
    }

    /// μ and S^{-1/2} from simulated features, in the form of the test.
    pub fn whiten(&self, features: &Array2<f64>) -> Result<Whitening, EstimatorError> {
        match self.form {
            GateForm::Calibrated => Whitening::calibrated(features),
            GateForm::Paper => Whitening::regularised(features, self.epsilon),
        }
        .map_err(EstimatorError::Whitening)
    }
}
