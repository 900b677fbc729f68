//! Recipes: features, network and settings of an estimator.

use crate::estimator::settings::Settings;
use crate::feature::{Ar, Arx, FeatureRecipe, Score};
use crate::likelihood::likelihood_of;
use crate::network::{Architecture, Deep, architecture};
use crate::study::Study;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Name of one of the two recipes of a [`Project`](super::Project).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum PresetName {
    /// The paper's method; what its text leaves open is taken from the authors' code.
    Paper,
    /// This project's improved method, for any twin.
    #[default]
    Default,
}

impl std::fmt::Display for PresetName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Paper => "paper",
            Self::Default => "default",
        })
    }
}

/// Features, network and settings of an estimator.
#[derive(Debug, Clone)]
pub struct Recipe {
    /// Stage 1: record to features.
    pub features: Arc<dyn FeatureRecipe>,
    /// Stage 2: features to parameters.
    pub architecture: Arc<dyn Architecture>,
    /// All numbers of the method.
    pub settings: Settings,
}

impl Recipe {
    /// Returns the default recipe: the [`Score`] of a twin with equations (AR(5) or ARX(8, 8) of a black box), and [`Deep`].
    pub(super) fn standard(study: &Study) -> Self {
        let features: Arc<dyn FeatureRecipe> = match likelihood_of(study.twin()).is_simulated() {
            false => Arc::new(Score::default()),
            true => regression(study),
        };
        Self {
            features,
            architecture: architecture::<Deep>(),
            settings: Settings::default(),
        }
    }
}

/// Steps of an estimate in which the presets differ.
#[derive(Debug, Clone, Copy)]
pub(super) struct Steps {
    /// The record is fitted by its likelihood; tests and simulations take the noise that it shows.
    pub fits_noise: bool,
    /// The network's estimate is kept if the gate agrees.
    pub trusts_prior: bool,
    /// A refit that explains the record worse than the network's estimate is refused.
    pub compares: bool,
}

impl Steps {
    /// The steps of a preset.
    pub fn of(preset: PresetName, study: &Study) -> Self {
        match preset {
            PresetName::Paper => Self::PAPER,
            PresetName::Default => Self {
                fits_noise: true,
                trusts_prior: study.trusts_prior(),
                compares: true,
            },
        }
    }
}

/// The features of a twin that shows no equations, and of the paper.
pub(super) fn regression(study: &Study) -> Arc<dyn FeatureRecipe> {
    if study.twin().signals().inputs.is_empty() {
        Arc::new(Ar { order: 5 })
    } else {
        Arc::new(Arx {
            outputs: 8,
            inputs: 8,
        })
    }
}
