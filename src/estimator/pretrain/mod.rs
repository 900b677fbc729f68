//! Pretraining: a bank of simulations, and a network trained on it; it can be interrupted.

use crate::estimator::bank::{Bank, Draws, Prior};
use crate::estimator::budget::BUDGET;
use crate::estimator::error::EstimatorError;
use crate::estimator::estimator::Estimator;
use crate::estimator::project::{PresetName, Project};
use crate::estimator::readout::{Calibration, Readout, Scaler, Standardiser};
use crate::estimator::settings::{Inputs, Settings};
use crate::estimator::shards::{BankPlan, ShardedBank};
use crate::network::{Checkpoints, History, NetworkError, Samples};
use crate::progress::Progress;
use crate::storage::files::write_result;
use crate::storage::reading::link_to_nothing;
use crate::storage::work::{Manifest, Share, WorkFolder};
use crate::storage::{StorageError, sweep_beside};
use ndarray::Array2;
use serde_json::json;
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Most simulations of a bank in memory.
const MOST_IN_MEMORY: usize = 10_000_000;
/// Layout of the folder; raised when it changes.
const LAYOUT: u32 = 1;
const VERB: &str = "pretrain";
/// Ending of the folder's name, after that of the estimator.
const ENDING: &str = ".part";
const BANK: &str = "bank";
const TRAINING: &str = "training";
/// Default time between two checkpoints: little is lost, and nobody waits for the disk.
const CHECKPOINT: Duration = Duration::from_secs(10);

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
struct PretrainPlan<'a> {
    project: &'a Project,
    options: PretrainOptions,
    /// The preset's numbers with those that the options replace.
    settings: Settings,
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
        (recipe.check_width(prior.dim())).map_err(EstimatorError::Inputs)?;
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
        let d = project.study().twin().parameters().len();
        for (what, given, expected) in [
            ("parameters", first.theta.ncols(), d),
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
            Inputs::Principal => Standardiser::principal(&first.features, BUDGET.largest_input)
                .map_err(|error| {
                    let problem =
                        format!("the features of the bank cannot be standardised: {error}");
                    EstimatorError::Inputs(problem)
                })?,
        };
        let targets = Scaler::fit(&first.theta);
        let samples = Samples {
            features: prior.dim(),
            targets: d,
            parts: bank.parts(),
            read: Box::new(|index| {
                let draws = bank.part(index)?;
                let features = inputs.apply(&draws.features);
                Ok((
                    Cow::Owned(features),
                    Cow::Owned(targets.apply(&draws.theta)),
                ))
            }),
        };
        let training = &settings.training;
        let (network, history) =
            (recipe.architecture).train_on(&samples, training, seed, checkpoints, progress)?;
        drop(samples);
        let stage = progress.stage("calibration", BUDGET.calibration);
        let Draws {
            theta, features, ..
        } = prior.rows(0..BUDGET.calibration as u64, seed, "calibration", &stage)?;
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

/// The first rows of a bank, or all: rows are alike, and so many tell means and deviations well enough.
fn first_rows(bank: &dyn Bank) -> Result<Draws, EstimatorError> {
    let sizes = bank.parts();
    let rows = sizes.iter().sum::<usize>().min(BUDGET.standard_rows);
    let parts = (0..sizes.len()).map(|index| bank.part(index));
    Draws::stacked(rows, parts, |index| {
        EstimatorError::Bank(format!(
            "part {index} of the bank: another number of features; make the bank again"
        ))
    })
}

/// A pretraining whose work is kept beside the estimator's place until that is there.
///
/// The folder `EST.part` takes the bank, shard by shard, and the state of the training. Interrupted at any moment, the same
/// pretraining goes on with it, and gives the bytes of one that nothing has disturbed, which are also those of
/// [`pretrain`](pretrain()) and [`save`](Estimator::save).
pub struct Pretraining {
    /// Study and recipes.
    pub project: Project,
    /// Preset, sizes, seed.
    pub options: PretrainOptions,
    /// A bank that is there, with the checksum of its content; [`PretrainOptions::bank_size`] says nothing then.
    pub bank: Option<(Box<dyn Bank>, String)>,
    /// Time between two checkpoints of the training.
    pub every: Duration,
}

impl Pretraining {
    /// Creates a pretraining on simulations of its own, with a checkpoint each 10 s.
    pub fn new(project: impl Into<Project>, options: PretrainOptions) -> Self {
        Self {
            project: project.into(),
            options,
            bank: None,
            every: CHECKPOINT,
        }
    }

    /// Refuses settings that no estimator can be trained with; nothing is written.
    pub(crate) fn check(&self) -> Result<(), EstimatorError> {
        let plan = PretrainPlan::new(&self.project, self.sized())?;
        match self.bank {
            Some(_) => Ok(()),
            None => plan.size_in_memory().map(|_| ()),
        }
    }

    /// Returns where the work on the estimator at `path` is kept.
    pub fn work_folder(path: &Path) -> PathBuf {
        let mut name = path.as_os_str().to_owned();
        name.push(ENDING);
        name.into()
    }

    /// Pretrains, or goes on with it, and writes the estimator.
    ///
    /// An estimator that is there already is written again only where the folder of this very pretraining is still there: what
    /// made it was interrupted before it had cleared up.
    pub fn write(
        &self,
        path: &Path,
        progress: &Progress,
    ) -> Result<(Estimator, History), EstimatorError> {
        // What the network cannot take is said before anything is simulated.
        let plan = PretrainPlan::new(&self.project, self.sized())?;
        let manifest = self.manifest(&plan.settings)?;
        let place = Self::work_folder(path);
        sweep_beside(path);
        if path.symlink_metadata().is_ok() && WorkFolder::resume(&place, &manifest).is_err() {
            let problem = match link_to_nothing(path) {
                Some(problem) => format!("{problem}; remove it"),
                None => "exists already; choose another name, or remove it".into(),
            };
            return Err(EstimatorError::file(path, problem));
        }
        let folder = WorkFolder::open::<EstimatorError>(&place, &manifest, &[], |_| Ok(None))?;
        let lock = folder.lock()?;
        let is_again = path.symlink_metadata().is_ok();
        let made = self.made(plan, &folder, progress).and_then(|made| {
            match is_again {
                true => made.0.save_again(path),
                false => write_result(path, |path| made.0.save(path)),
            }?;
            Ok(made)
        });
        drop(lock);
        match &made {
            Ok(_) | Err(EstimatorError::Work(StorageError::Kept { .. })) => folder.remove()?,
            Err(EstimatorError::Work(StorageError::Elsewhere { .. })) => drop(folder.remove()),
            // It would only stand in the way of the next call. What is wrong is said, not that it cannot be removed either.
            Err(error) if ends_for_good(error) || is_bare(&folder) => drop(folder.remove()),
            Err(_) => {}
        }
        made
    }

    /// The estimator, by what is in the folder and what is still to be done.
    fn made(
        &self,
        plan: PretrainPlan<'_>,
        folder: &WorkFolder,
        progress: &Progress,
    ) -> Result<(Estimator, History), EstimatorError> {
        let checkpoints = Checkpoints::new(folder.file(TRAINING), self.every);
        let simulated;
        let bank = match &self.bank {
            Some((bank, _)) => &**bank,
            None => {
                let path = folder.file(BANK);
                let bank = BankPlan {
                    project: self.project.clone(),
                    preset: self.options.preset,
                    size: plan.size_in_memory()?,
                    seed: self.options.seed,
                };
                bank.fill(&path, Share::WHOLE, progress)?;
                // As one part: rows in the order in which they would be without a folder.
                simulated = ShardedBank::open(&path)?.read()?;
                &simulated
            }
        };
        plan.train(bank, &checkpoints, progress)
    }

    /// The options, with the size of the bank that is given.
    fn sized(&self) -> PretrainOptions {
        let given = self.bank.as_ref().map(|(bank, _)| bank.rows());
        PretrainOptions {
            bank_size: given.or(self.options.bank_size),
            ..self.options
        }
    }

    /// Everything that the estimator depends on.
    fn manifest(&self, settings: &Settings) -> Result<Manifest, EstimatorError> {
        let preset = self.project.recipe(self.options.preset);
        let bank = match &self.bank {
            Some((_, checksum)) => checksum.clone(),
            None => "simulated".into(),
        };
        let study = self.project.study();
        Ok((study.manifest(VERB, LAYOUT)?)
            .with("features", json!(preset.features))
            .with("network", preset.architecture.id())
            .with("settings", json!(settings))
            .with("bank", bank)
            .with("seed", self.options.seed))
    }
}

/// Returns whether the same call would end with the same error again.
fn ends_for_good(error: &EstimatorError) -> bool {
    matches!(
        error,
        EstimatorError::Setting(_)
            | EstimatorError::Study(_)
            | EstimatorError::Feature(_)
            | EstimatorError::Inputs(_)
            | EstimatorError::Undetermined(_)
            | EstimatorError::Network(NetworkError::Diverged { .. })
    )
}

/// Returns whether nothing is kept in the folder yet.
fn is_bare(folder: &WorkFolder) -> bool {
    !folder.file(TRAINING).exists() && !ShardedBank::is_begun(&folder.file(BANK))
}

#[cfg(test)]
mod tests;
