//! Settings and history of a training.

use super::NetworkError;
use crate::setting::SettingError;
use serde::{Deserialize, Serialize};

/// Learning rate over the epochs e = 0 … E−1.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Schedule {
    /// The same in every epoch.
    #[default]
    Constant,
    /// η·½(1 + cos(πe/E)): from η down towards 0.
    Cosine,
}

/// Settings of a training, of trunk and heads or of heads alone.
///
/// The loss of a mini-batch B, with predictions ŷ, targets y and first head weights U_j, is
///
/// ```text
/// 1/|B| Σ_i Σ_j w_j·huber_δ(ŷ_ij − y_ij)  +  λ Σ_{j<k} ‖U_j U_kᵀ‖_F²
/// huber_δ(r) = r²/2 where |r| < δ, else δ(|r| − δ/2)
/// ```
///
/// | field | default | range | meaning |
/// |---|---|---|---|
/// | `epochs` | 200 | ≥ 1 | most passes over the training rows |
/// | `batch` | 64 | ≥ 1 | rows of a mini-batch; the last one of an epoch may be smaller |
/// | `learning_rate` | 1e-3 | > 0 | η of Adam |
/// | `schedule` | constant | constant, cosine | how η moves over the epochs |
/// | `weight_decay` | 1e-5 | ≥ 0 | c of the c·w that is added to each gradient (plain L2, as in PyTorch's Adam) |
/// | `huber_delta` | 0.6 | > 0 | δ, in units of the (standardised) targets |
/// | `orthogonality` | 0 | ≥ 0 | λ |
/// | `target_weights` | empty | ≥ 0 each | w_j, one for each target; empty: all 1 |
/// | `holdout` | 0.2 | [0, 1) | share of the rows that is kept out to choose the best epoch; 0: none, the last epoch stays |
/// | `patience` | 25 | ≥ 0 | epochs without a better holdout loss before training stops; 0: never stops early |
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Training {
    /// Most passes over the training rows.
    pub epochs: usize,
    /// Rows of a mini-batch.
    pub batch: usize,
    /// Adam's learning rate η.
    pub learning_rate: f64,
    /// Learning rate η over the epochs.
    pub schedule: Schedule,
    /// L2 coefficient, added to the gradient.
    pub weight_decay: f64,
    /// δ of the Huber loss, in units of the targets.
    pub huber_delta: f64,
    /// λ of the orthogonality penalty.
    pub orthogonality: f64,
    /// w_j, one for each target; empty means all 1.
    pub target_weights: Vec<f64>,
    /// Share of the rows that chooses the best epoch; 0 for none.
    pub holdout: f64,
    /// Epochs without improvement before training stops; 0 for never.
    pub patience: usize,
}

impl Default for Training {
    fn default() -> Self {
        Self {
            epochs: 200,
            batch: 64,
            learning_rate: 1e-3,
            schedule: Schedule::Constant,
            weight_decay: 1e-5,
            huber_delta: 0.6,
            orthogonality: 0.0,
            target_weights: Vec::new(),
            holdout: 0.2,
            patience: 25,
        }
    }
}

impl Training {
    /// Checks each field against its range.
    ///
    /// # Errors
    ///
    /// [`SettingError`] names the first field outside its range, its value and the remedy.
    pub fn check(&self) -> Result<(), SettingError> {
        let not_negative = |v: f64| v >= 0.0 && v.is_finite();
        for (field, count) in [("epochs", self.epochs), ("batch", self.batch)] {
            SettingError::unless(count > 0, field, count, "must be at least 1")?;
        }
        for (field, value) in [
            ("learning_rate", self.learning_rate),
            ("huber_delta", self.huber_delta),
        ] {
            let valid = value > 0.0 && value.is_finite();
            SettingError::unless(valid, field, value, "must be finite and above 0")?;
        }
        for (field, value) in [
            ("weight_decay", self.weight_decay),
            ("orthogonality", self.orthogonality),
        ] {
            let remedy = "must be finite and not below 0";
            SettingError::unless(not_negative(value), field, value, remedy)?;
        }
        for &weight in &self.target_weights {
            let remedy = "each weight must be finite and not below 0";
            SettingError::unless(not_negative(weight), "target_weights", weight, remedy)?;
        }
        let remedy = "must be at least 0 and below 1; 0 keeps nothing out";
        let valid = (0.0..1.0).contains(&self.holdout);
        SettingError::unless(valid, "holdout", self.holdout, remedy)
    }

    /// One weight for each of `outputs` targets.
    pub(super) fn weights_for(&self, outputs: usize) -> Result<Vec<f32>, NetworkError> {
        match self.target_weights.len() {
            0 => Ok(vec![1.0; outputs]),
            n if n == outputs => Ok(self.target_weights.iter().map(|w| *w as f32).collect()),
            n => Err(SettingError::new(
                "target_weights",
                format!("{n} weights"),
                format!("give {outputs}, one for each target, or none"),
            )
            .into()),
        }
    }

    /// Learning rate of `epoch`, counted from 0.
    pub(super) fn rate(&self, epoch: usize) -> f64 {
        match self.schedule {
            Schedule::Constant => self.learning_rate,
            Schedule::Cosine => {
                let phase = std::f64::consts::PI * epoch as f64 / self.epochs as f64;
                self.learning_rate * 0.5 * (1.0 + phase.cos())
            }
        }
    }
}

/// Losses of a training, epoch by epoch.
///
/// Both losses are Σ_j w_j·huber_δ, averaged over rows and without the orthogonality penalty, so that they can be
/// compared; the training loss is measured on the way, with dropout.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct History {
    /// Training loss of each epoch.
    pub training: Vec<f64>,
    /// Holdout loss of each epoch; empty without holdout rows.
    pub holdout: Vec<f64>,
    /// The epoch, from 0, whose weights the network has: the best on the holdout rows, or the last one.
    pub best_epoch: usize,
    /// Epochs that were run; fewer than asked for after an early stop.
    pub epochs_run: usize,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_setting_is_named_with_its_remedy() {
        let wrong = Training {
            learning_rate: -1.0,
            ..Training::default()
        };
        assert_eq!(
            wrong.check().unwrap_err().to_string(),
            "learning_rate = -1; must be finite and above 0"
        );
        let wrong = Training {
            target_weights: vec![1.0, f64::NAN],
            ..Training::default()
        };
        let said = wrong.check().unwrap_err().to_string();
        assert!(said.starts_with("target_weights = NaN"), "{said}");
        for holdout in [-0.1, 1.0, f64::NAN] {
            let wrong = Training {
                holdout,
                ..Training::default()
            };
            assert!(wrong.check().is_err());
        }
        assert_eq!(Training::default().check(), Ok(()));
    }

    #[test]
    fn unknown_fields_are_refused_and_absent_ones_take_defaults() {
        let read: Training = toml::from_str("epochs = 3\nschedule = \"cosine\"").unwrap();
        assert_eq!((read.epochs, read.batch), (3, 64));
        assert_eq!(read.schedule, Schedule::Cosine);
        assert!(toml::from_str::<Training>("epoch = 3").is_err());
    }

    #[test]
    fn the_cosine_starts_at_the_learning_rate_and_sinks() {
        let cosine = Training {
            schedule: Schedule::Cosine,
            epochs: 10,
            ..Training::default()
        };
        assert_eq!(cosine.rate(0), 1e-3);
        assert!((cosine.rate(5) - 0.5e-3).abs() < 1e-12);
        assert!(cosine.rate(9) < 0.03e-3);
    }
}
