//! Bank and training.

use crate::estimator::bank::{Bank, Draws};
use crate::estimator::error::EstimatorError;
use crate::estimator::estimator::Estimator;
use crate::estimator::project::Project;
use crate::estimator::readout::{Calibration, Readout, Scaler, Standardiser};
use crate::estimator::recipe::PresetName;
use crate::estimator::settings::{Inputs, Settings};
use crate::estimator::shards::Prior;
use crate::network::{Checkpoints, History, Part, Samples};
use crate::progress::Progress;
use ndarray::Array2;
use std::borrow::Cow;
use std::error::Error;

/// Simulations apart from the bank, on which the error of the network is measured.
const CALIBRATION: usize = 1000;
/// Rows that inputs and targets are standardised with.
const STANDARD: usize = 20_000;
/// Most simulations of a bank in memory.
const MOST_IN_MEMORY: usize = 10_000_000;
/// Largest network input, in standard deviations of the bank: far outside, the network should not extrapolate.
const LIMIT: f64 = 6.0;

/// Options of a pretraining.
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

/// Simulates a bank from the prior, in memory, and trains the network on it.
///
/// θ is uniform in the prior, each simulation has its own noise and, where the study draws inputs, its own input.
/// Targets are standardised, which makes equal weights the paper's w_j = 1/Var(θ_j).
///
/// # Errors
///
/// [`EstimatorError`].
///
/// Source: Lakshminarayanan, Guerrero & Rojas, section III.
pub fn pretrain(
    project: impl Into<Project>,
    options: &PretrainOptions,
    progress: &Progress,
) -> Result<(Estimator, History), EstimatorError> {
    let project = &project.into();
    let settings = settings(project, options)?;
    let size = settings.bank_size;
    fits_into_memory(size)?;
    let prior = prior(project, options)?;
    let stage = progress.stage("bank", size);
    let bank = prior.rows(0..size as u64, options.seed, "bank", &stage)?;
    let nowhere = Checkpoints::none();
    train(
        project, options, settings, &prior, &bank, &nowhere, progress,
    )
}

/// Trains the network on a bank that is there, of this study's prior and the preset's features; goes on with what was kept of the training.
///
/// A bank of at most 64 MiB as 32-bit numbers gives, row for row, the estimator of [`pretrain`]; of a larger one, no more than
/// that is in memory at a time.
///
/// # Errors
///
/// [`EstimatorError`]; also for rows of another width.
pub(super) fn pretrain_from(
    project: &Project,
    bank: &dyn Bank,
    options: &PretrainOptions,
    checkpoints: &Checkpoints,
    progress: &Progress,
) -> Result<(Estimator, History), EstimatorError> {
    let options = PretrainOptions {
        bank_size: Some(bank.rows()),
        ..*options
    };
    let settings = settings(project, &options)?;
    let prior = prior(project, &options)?;
    train(
        project,
        &options,
        settings,
        &prior,
        bank,
        checkpoints,
        progress,
    )
}

/// Refuses a bank that is too large.
pub(super) fn fits_into_memory(size: usize) -> Result<(), EstimatorError> {
    if size <= MOST_IN_MEMORY {
        return Ok(());
    }
    Err(EstimatorError::Bank(format!(
        "bank size = {size}; at most {MOST_IN_MEMORY} fit into memory: make a bank on disk, then pretrain from it"
    )))
}

/// The preset's numbers with what the options say otherwise, checked.
pub(super) fn settings(
    project: &Project,
    options: &PretrainOptions,
) -> Result<Settings, EstimatorError> {
    let mut settings = project.recipe(options.preset).settings.clone();
    settings.bank_size = options.bank_size.unwrap_or(settings.bank_size);
    settings.training.epochs = options.epochs.unwrap_or(settings.training.epochs);
    settings.check()?;
    Ok(settings)
}

/// The prior through the preset's features, which the network must take.
pub(super) fn prior(project: &Project, options: &PretrainOptions) -> Result<Prior, EstimatorError> {
    project.study().check_estimated()?;
    let preset = project.recipe(options.preset);
    let prior = Prior::new(project.study(), preset.features.as_ref())?;
    let most = preset.architecture.max_features();
    if prior.dim() > most {
        return Err(EstimatorError::Inputs(format!(
            "the features are {} numbers, network \"{}\" takes at most {most}; lower their order or choose a wider network",
            prior.dim(),
            preset.architecture.id()
        )));
    }
    Ok(prior)
}

fn train(
    project: &Project,
    options: &PretrainOptions,
    settings: Settings,
    prior: &Prior,
    bank: &dyn Bank,
    checkpoints: &Checkpoints,
    progress: &Progress,
) -> Result<(Estimator, History), EstimatorError> {
    let preset = project.recipe(options.preset);
    let seed = options.seed;
    let first = first_rows(bank)?;
    for (what, given, expected) in [
        (
            "parameters",
            first.theta.ncols(),
            project.study().twin().parameters().len(),
        ),
        ("features", first.features.ncols(), prior.dim()),
    ] {
        if given != expected {
            return Err(EstimatorError::Bank(format!(
                "the bank has {given} {what}, twin and preset have {expected}; make a bank with this study and preset"
            )));
        }
    }
    let inputs = match settings.inputs {
        Inputs::Each => Standardiser::each(&first.features),
        Inputs::Principal => Standardiser::principal(&first.features, LIMIT).map_err(|error| {
            EstimatorError::Inputs(format!(
                "the features of the bank cannot be standardised: {error}"
            ))
        })?,
    };
    let targets = Scaler::fit(&first.theta);
    let samples = Standardised {
        bank,
        inputs: &inputs,
        targets: &targets,
    };
    let (network, history) = (preset.architecture).train_on(
        &samples,
        &settings.training,
        seed,
        checkpoints,
        progress,
    )?;
    let stage = progress.stage("calibration", CALIBRATION);
    let calibration = prior.rows(0..CALIBRATION as u64, seed, "calibration", &stage)?;
    let mut estimator = Estimator {
        project: project.clone(),
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

/// The first [`STANDARD`] rows of a bank, or all: rows are alike, and so many tell means and deviations well enough.
fn first_rows(bank: &dyn Bank) -> Result<Draws, EstimatorError> {
    let sizes = bank.parts();
    let rows = sizes.iter().sum::<usize>().min(STANDARD);
    let parts = (0..sizes.len()).map(|index| bank.part(index));
    Draws::stacked(rows, parts, |index| {
        EstimatorError::Bank(format!(
            "part {index} of the bank: another number of features; make the bank again"
        ))
    })
}

/// A bank as the network sees it.
struct Standardised<'a> {
    bank: &'a dyn Bank,
    inputs: &'a Standardiser,
    targets: &'a Scaler,
}

impl Samples for Standardised<'_> {
    fn features(&self) -> usize {
        self.inputs.mean.len()
    }

    fn targets(&self) -> usize {
        self.targets.mean.len()
    }

    fn parts(&self) -> Vec<usize> {
        self.bank.parts()
    }

    fn part(&self, index: usize) -> Result<Part<'_>, Box<dyn Error + Send + Sync>> {
        let draws = self.bank.part(index)?;
        let features = self.inputs.apply(&draws.features);
        let targets = self.targets.apply(&draws.theta);
        Ok((Cow::Owned(features), Cow::Owned(targets)))
    }
}
