//! Bank and training.

use crate::estimator::bank::{Bank, Draws, Prior};
use crate::estimator::error::EstimatorError;
use crate::estimator::estimator::Estimator;
use crate::estimator::project::Project;
use crate::estimator::readout::{Calibration, Readout, Scaler, Standardiser};
use crate::estimator::recipe::PresetName;
use crate::estimator::settings::{Inputs, Settings};
use crate::network::{Checkpoints, History, SamplePart, Samples};
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
    let plan = PretrainPlan::new(project, *options)?;
    let size = plan.size_in_memory()?;
    let stage = progress.stage("bank", size);
    let bank = (plan.prior).rows(0..size as u64, options.seed, "bank", &stage)?;
    plan.train(&bank, &Checkpoints::none(), progress)
}

/// A pretraining whose settings are checked and whose features the network takes.
pub(super) struct PretrainPlan<'a> {
    project: &'a Project,
    options: PretrainOptions,
    /// The preset's numbers with those that the options replace.
    pub settings: Settings,
    /// The prior through the preset's features.
    prior: Prior,
}

impl<'a> PretrainPlan<'a> {
    pub fn new(project: &'a Project, options: PretrainOptions) -> Result<Self, EstimatorError> {
        let recipe = project.recipe(options.preset);
        let mut settings = recipe.settings.clone();
        settings.bank_size = options.bank_size.unwrap_or(settings.bank_size);
        settings.training.epochs = options.epochs.unwrap_or(settings.training.epochs);
        settings.check()?;
        let prior = Prior::new(project.study(), recipe.features.as_ref())?;
        let most = recipe.architecture.max_features();
        if prior.dim() > most {
            return Err(EstimatorError::Inputs(format!(
                "the features are {} numbers, network \"{}\" takes at most {most}; lower their order or choose a wider network",
                prior.dim(),
                recipe.architecture.id()
            )));
        }
        Ok(Self {
            project,
            options,
            settings,
            prior,
        })
    }

    /// Rows of the bank; refuses one that is too large for the memory.
    pub fn size_in_memory(&self) -> Result<usize, EstimatorError> {
        match self.settings.bank_size {
            size if size <= MOST_IN_MEMORY => Ok(size),
            size => Err(EstimatorError::TooLarge {
                size,
                most: MOST_IN_MEMORY,
            }),
        }
    }

    /// Trains the network on a bank of this study's prior and the preset's features; goes on with what was kept of the training.
    ///
    /// A bank of at most 64 MiB as 32-bit numbers gives, row for row, the estimator of [`pretrain`]; of a larger one, no more than
    /// that is in memory at a time.
    ///
    /// # Errors
    ///
    /// [`EstimatorError`]; also for rows of another width.
    pub fn train(
        self,
        bank: &dyn Bank,
        checkpoints: &Checkpoints,
        progress: &Progress,
    ) -> Result<(Estimator, History), EstimatorError> {
        let Self {
            project,
            options: PretrainOptions { preset, seed, .. },
            settings,
            prior,
        } = self;
        let recipe = project.recipe(preset);
        let first = first_rows(bank)?;
        let parameters = project.study().twin().parameters().len();
        for (what, given, expected) in [
            ("parameters", first.theta.ncols(), parameters),
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
            Inputs::Principal => {
                Standardiser::principal(&first.features, LIMIT).map_err(|error| {
                    EstimatorError::Inputs(format!(
                        "the features of the bank cannot be standardised: {error}"
                    ))
                })?
            }
        };
        let targets = Scaler::fit(&first.theta);
        let samples = Standardised {
            bank,
            inputs: &inputs,
            targets: &targets,
        };
        let training = &settings.training;
        let (network, history) =
            (recipe.architecture).train_on(&samples, training, seed, checkpoints, progress)?;
        let stage = progress.stage("calibration", CALIBRATION);
        let Draws {
            theta, features, ..
        } = prior.rows(0..CALIBRATION as u64, seed, "calibration", &stage)?;
        let mut estimator = Estimator {
            project: project.clone(),
            preset,
            settings,
            recipe: recipe.features.clone(),
            architecture: recipe.architecture.clone(),
            readout: Readout {
                inputs,
                targets,
                layer: None,
                network,
            },
            calibration: Calibration {
                predicted: Array2::zeros(theta.dim()),
                truth: theta,
            },
            seed,
        };
        estimator.calibration.predicted = estimator.predict(&features)?;
        Ok((estimator, history))
    }
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

    fn part(&self, index: usize) -> Result<SamplePart<'_>, Box<dyn Error + Send + Sync>> {
        let draws = self.bank.part(index)?;
        let features = self.inputs.apply(&draws.features);
        let targets = self.targets.apply(&draws.theta);
        Ok((Cow::Owned(features), Cow::Owned(targets)))
    }
}
