//! The paper's preset, apart from the default one: its features, its numbers, its steps.
//!
//! Source: Lakshminarayanan, Guerrero & Rojas, "Fine-Tuning a Simulation-Driven Estimator"; what its text leaves open is from the authors'
//! code.

use crate::estimator::project::{Recipe, Steps, regression};
use crate::estimator::settings::{
    CloudSampler, CloudSettings, GateForm, GateSettings, Inputs, RefineSettings, Settings,
};
use crate::network::{Deep, Training, architecture};
use crate::study::Study;

impl Steps {
    /// Takes the prior and the declared noise at their word, and the refit as the answer.
    pub(super) const PAPER: Self = Self {
        fits_noise: false,
        trusts_prior: true,
        compares: false,
    };
}

impl Recipe {
    /// Returns the paper's recipe: AR(5), or ARX(8, 8) of a twin with inputs, and [`Deep`].
    pub(super) fn paper(study: &Study) -> Self {
        Self {
            features: regression(study),
            architecture: architecture::<Deep>(),
            settings: Settings::paper(),
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
}
