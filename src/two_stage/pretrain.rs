//! Bank and training.

use super::readout::Readout;
use super::{Calibration, Estimator, Scaler, Standardiser};
use crate::bank::{BankError, Draw, Draws, FeatureSimulator};
use crate::feature::FeatureError;
use crate::math::WhiteningError;
use crate::network::{History, NetworkError};
use crate::progress::Progress;
use crate::study::{DriveSource, Inputs, PlanError, PresetName, SettingsError, Study};
use crate::twin::Noise;
use ndarray::Array2;
use std::borrow::Cow;

/// Simulations apart from the bank, on which the error of the network is measured.
const CALIBRATION: usize = 1000;
/// Largest network input, in standard deviations of the bank: far outside, the network should not extrapolate.
const LIMIT: f64 = 6.0;

/// What may be chosen for a pretraining.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PretrainOptions {
    /// Recipe.
    pub preset: PresetName,
    /// Simulations to train on; the recipe's if `None`.
    pub bank_size: Option<usize>,
    /// Passes over the bank; the recipe's if `None`.
    pub epochs: Option<usize>,
    /// Seed of everything.
    pub seed: u64,
}

/// Why there is no estimator.
#[derive(Debug, thiserror::Error)]
pub enum PretrainError {
    /// Of the recipe.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// Of step, length, input.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// Of the features.
    #[error(transparent)]
    Feature(#[from] FeatureError),
    /// Of the simulations.
    #[error(transparent)]
    Bank(#[from] BankError),
    /// Of the training.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// The features of the bank do not vary, or are not finite.
    #[error("the features of the bank cannot be standardised: {0}")]
    Standardise(#[from] WhiteningError),
    /// More features than the network takes.
    #[error(
        "the features are {features} numbers, network \"{network}\" takes at most {most}; lower their order or choose a wider network"
    )]
    TooManyFeatures {
        /// Features.
        features: usize,
        /// Network.
        network: &'static str,
        /// Its limit.
        most: usize,
    },
}

/// Simulates a bank from the prior and trains the network on it.
///
/// θ is uniform in the prior, each simulation has its own noise and, where the study draws inputs, its own input.
/// Targets are standardised, which makes equal weights the paper's w_j = 1/Var(θ_j).
///
/// Source: Lakshminarayanan, Guerrero & Rojas, section III.
pub fn pretrain(
    study: &Study,
    options: &PretrainOptions,
    progress: &Progress,
) -> Result<(Estimator, History), PretrainError> {
    let preset = study.preset(options.preset);
    let mut settings = preset.settings.clone();
    settings.bank_size = options.bank_size.unwrap_or(settings.bank_size);
    settings.training.epochs = options.epochs.unwrap_or(settings.training.epochs);
    settings.check()?;
    let simulator = FeatureSimulator::new(study.twin().clone(), preset.features.as_ref())?;
    let most = preset.architecture.max_features();
    if simulator.dim() > most {
        return Err(PretrainError::TooManyFeatures {
            features: simulator.dim(),
            network: preset.architecture.id(),
            most,
        });
    }
    let drives = study.drives()?;
    let stage = progress.stage("bank", settings.bank_size + CALIBRATION);
    let seed = options.seed;
    let bank =
        |size, purpose: &'static str| simulate(&simulator, &drives, size, seed, purpose, &stage);
    let training = bank(settings.bank_size, "bank")?;
    let calibration = bank(CALIBRATION, "calibration")?;
    let inputs = match settings.inputs {
        Inputs::Each => Standardiser::each(&training.features),
        Inputs::Principal => Standardiser::principal(&training.features, LIMIT)?,
    };
    let targets = Scaler::fit(&training.theta);
    let (network, history) = preset.architecture.train(
        &inputs.apply(&training.features),
        &targets.apply(&training.theta),
        &settings.training,
        seed,
        progress,
    )?;
    let mut estimator = Estimator {
        study: study.clone(),
        preset: options.preset,
        settings,
        recipe: preset.features.clone(),
        architecture: preset.architecture.clone(),
        readout: Readout {
            inputs,
            targets,
            layer: None,
            network,
        },
        calibration: Calibration {
            predicted: Array2::zeros(calibration.theta.dim()),
            truth: calibration.theta,
        },
        seed,
    };
    estimator.calibration.predicted = estimator.predict(&calibration.features)?;
    Ok((estimator, history))
}

/// A bank from the prior.
fn simulate(
    simulator: &FeatureSimulator,
    drives: &DriveSource,
    size: usize,
    seed: u64,
    purpose: &str,
    stage: &crate::progress::Stage,
) -> Result<Draws, BankError> {
    let space = simulator.twin().parameters();
    simulator.draws(
        size,
        |i| Noise::new(seed, purpose, i),
        |_, _, noise| {
            let drive = drives
                .draw(noise)
                .map_err(|error| BankError::Input(error.to_string()))?;
            Ok(Some(Draw {
                theta: space.draw_prior(noise),
                drive: Cow::Owned(drive),
            }))
        },
        stage,
    )
}
