//! Bank and training.

use super::calibration::Calibration;
use super::readout::Readout;
use super::{
    Estimator, EstimatorFileError, Inputs, PresetName, Project, Scaler, Settings, Standardiser,
};
use crate::estimator::bank::file::BankFileError;
use crate::estimator::bank::{Bank, BankError, Draws};
use crate::estimator::shards::{Prior, PriorError, ShardsError};
use crate::feature::FeatureError;
use crate::math::MathError;
use crate::network::{Checkpoints, History, NetworkError, Part, Samples};
use crate::progress::Progress;
use crate::setting::SettingError;
use crate::storage::StorageError;
use crate::study::PlanError;
use ndarray::Array2;
use std::borrow::Cow;
use std::error::Error;
use std::path::PathBuf;

/// Simulations apart from the bank, on which the error of the network is measured.
const CALIBRATION: usize = 1000;
/// Rows that inputs and targets are standardised with.
const STANDARD: usize = 20_000;
/// Most simulations of a bank in memory.
const MOST_IN_MEMORY: usize = 10_000_000;
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
///
/// ```
/// use truetwin::progress::Progress;
/// use truetwin::study::{RecordPlan, Study};
/// use truetwin::twins::VanDerPol;
/// use truetwin::estimator::{PretrainError, PretrainOptions, pretrain};
///
/// let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 200))?;
/// let too_few = PretrainOptions { bank_size: Some(3), ..PretrainOptions::default() };
/// let error = pretrain(&study, &too_few, &Progress::silent()).unwrap_err();
/// assert!(matches!(error, PretrainError::Settings(_)));
/// # Ok::<(), truetwin::study::StudyError>(())
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PretrainError {
    /// Of the recipe.
    #[error(transparent)]
    Settings(#[from] SettingError),
    /// Of step, length, input.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// Of the features.
    #[error(transparent)]
    Feature(#[from] FeatureError),
    /// Of the simulations.
    #[error(transparent)]
    Bank(#[from] BankError),
    /// Of a bank on disk.
    #[error(transparent)]
    File(#[from] BankFileError),
    /// More simulations than fit into memory.
    #[error(
        "bank size = {0}; at most {MOST_IN_MEMORY} fit into memory: make a bank on disk with `truetwin bank`, then pretrain --bank"
    )]
    Memory(usize),
    /// A bank of another width.
    #[error(
        "the bank has {given} {what}, twin and preset have {expected}; make a bank with this study and preset"
    )]
    Width {
        /// Parameters or features.
        what: &'static str,
        /// In the bank.
        given: usize,
        /// Of the study.
        expected: usize,
    },
    /// Of the folder in which a pretraining is kept.
    #[error(transparent)]
    Work(#[from] StorageError),
    /// Of the bank in that folder.
    #[error(transparent)]
    Shards(#[from] ShardsError),
    /// There is something in the estimator's place.
    #[error("{} exists already; choose another --out, or remove it", .0.display())]
    Taken(PathBuf),
    /// The estimator cannot be written.
    #[error(transparent)]
    Save(#[from] EstimatorFileError),
    /// Of the training.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// The features of the bank do not vary, or are not finite.
    #[error("the features of the bank cannot be standardised: {0}")]
    Standardise(#[from] MathError),
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

/// Simulates a bank from the prior, in memory, and trains the network on it.
///
/// θ is uniform in the prior, each simulation has its own noise and, where the study draws inputs, its own input.
/// Targets are standardised, which makes equal weights the paper's w_j = 1/Var(θ_j).
///
/// # Errors
///
/// [`PretrainError`].
///
/// Source: Lakshminarayanan, Guerrero & Rojas, section III.
pub fn pretrain(
    project: impl Into<Project>,
    options: &PretrainOptions,
    progress: &Progress,
) -> Result<(Estimator, History), PretrainError> {
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

/// Trains the network on a bank that is there, of this study's prior and the preset's features.
///
/// A bank of at most 64 MiB as 32-bit numbers gives, row for row, the estimator of [`pretrain`]; of a larger one, no more than
/// that is in memory at a time ([`Architecture::train_on`](crate::network::Architecture::train_on)).
///
/// # Errors
///
/// [`PretrainError`]; also for rows of another width.
///
/// ```
/// use truetwin::progress::Progress;
/// use truetwin::estimator::shards::Prior;
/// use truetwin::study::{RecordPlan, Study};
/// use truetwin::twins::VanDerPol;
/// use truetwin::estimator::{PresetName, PretrainOptions, Project, pretrain_on};
///
/// let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 100))?;
/// let project = Project::from(&study);
/// let features = &project.recipe(PresetName::Default).features;
/// let stage = Progress::silent().stage("bank", 150);
/// let bank = Prior::new(&study, features.as_ref())?.rows(0..150, 1, "bank", &stage)?;
///
/// let short = PretrainOptions { epochs: Some(2), ..PretrainOptions::default() };
/// let (estimator, history) = pretrain_on(&study, &bank, &short, &Progress::silent())?;
/// assert_eq!((estimator.settings().bank_size, history.epochs_run), (150, 2));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn pretrain_on(
    project: impl Into<Project>,
    bank: &dyn Bank,
    options: &PretrainOptions,
    progress: &Progress,
) -> Result<(Estimator, History), PretrainError> {
    let project = project.into();
    pretrain_from(&project, bank, options, &Checkpoints::none(), progress)
}

/// As [`pretrain_on`], and goes on with what was kept of the training.
pub(super) fn pretrain_from(
    project: &Project,
    bank: &dyn Bank,
    options: &PretrainOptions,
    checkpoints: &Checkpoints,
    progress: &Progress,
) -> Result<(Estimator, History), PretrainError> {
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
pub(super) fn fits_into_memory(size: usize) -> Result<(), PretrainError> {
    match size <= MOST_IN_MEMORY {
        true => Ok(()),
        false => Err(PretrainError::Memory(size)),
    }
}

/// The preset's numbers with what the options say otherwise, checked.
pub(super) fn settings(
    project: &Project,
    options: &PretrainOptions,
) -> Result<Settings, PretrainError> {
    let mut settings = project.recipe(options.preset).settings.clone();
    settings.bank_size = options.bank_size.unwrap_or(settings.bank_size);
    settings.training.epochs = options.epochs.unwrap_or(settings.training.epochs);
    settings.check()?;
    Ok(settings)
}

/// The prior through the preset's features, which the network must take.
pub(super) fn prior(project: &Project, options: &PretrainOptions) -> Result<Prior, PretrainError> {
    let preset = project.recipe(options.preset);
    let prior = Prior::new(project.study(), preset.features.as_ref())?;
    let most = preset.architecture.max_features();
    if prior.dim() > most {
        return Err(PretrainError::TooManyFeatures {
            features: prior.dim(),
            network: preset.architecture.id(),
            most,
        });
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
) -> Result<(Estimator, History), PretrainError> {
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
            return Err(PretrainError::Width {
                what,
                given,
                expected,
            });
        }
    }
    let inputs = match settings.inputs {
        Inputs::Each => Standardiser::each(&first.features),
        Inputs::Principal => Standardiser::principal(&first.features, LIMIT)?,
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
fn first_rows(bank: &dyn Bank) -> Result<Draws, BankFileError> {
    let sizes = bank.parts();
    let rows = sizes.iter().sum::<usize>().min(STANDARD);
    let parts = (0..sizes.len()).map(|index| bank.part(index));
    Draws::stacked(rows, parts, |index| BankFileError::Content {
        path: format!("part {index} of the bank").into(),
        reason: "another number of features".into(),
        remedy: "make the bank again",
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

impl From<PriorError> for PretrainError {
    fn from(error: PriorError) -> Self {
        match error {
            PriorError::Feature(error) => Self::Feature(error),
            PriorError::Plan(error) => Self::Plan(error),
        }
    }
}
