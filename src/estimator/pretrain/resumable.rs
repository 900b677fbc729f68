//! A pretraining that can be interrupted.

use super::train::{PretrainOptions, PretrainPlan};
use crate::estimator::bank::Bank;
use crate::estimator::error::EstimatorError;
use crate::estimator::estimator::Estimator;
use crate::estimator::project::Project;
use crate::estimator::shards::{BankPlan, ShardedBank};
use crate::network::{Checkpoints, History, NetworkError};
use crate::progress::Progress;
use crate::storage::sweep_beside;
use crate::storage::work::{Manifest, Share, WorkFolder};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Layout of the folder; raised when it changes.
const LAYOUT: u32 = 1;
const VERB: &str = "pretrain";
/// Ending of the folder's name, after that of the estimator.
const ENDING: &str = ".part";
const BANK: &str = "bank";
const TRAINING: &str = "training";
/// Default time between two checkpoints: little is lost, and nobody waits for the disk.
pub const CHECKPOINT: Duration = Duration::from_secs(10);

/// A pretraining whose work is kept beside the estimator's place until that is there.
///
/// The folder `EST.part` takes the bank, shard by shard, and the state of the training. Interrupted at any moment, the same
/// pretraining goes on with it, and gives the bytes of one that nothing has disturbed, which are also those of
/// [`pretrain`](super::pretrain()) and [`save`](Estimator::save).
pub struct Pretraining<'a> {
    project: Project,
    options: PretrainOptions,
    bank: Option<GivenBank<'a>>,
    every: Duration,
}

/// A bank to train on that is there.
pub struct GivenBank<'a> {
    /// Its rows.
    pub bank: &'a dyn Bank,
    /// Checksum of the content.
    pub checksum: String,
}

impl<'a> Pretraining<'a> {
    /// On simulations of its own.
    pub fn new(project: impl Into<Project>, options: PretrainOptions) -> Self {
        Self {
            project: project.into(),
            options,
            bank: None,
            every: CHECKPOINT,
        }
    }

    /// On a bank that is there; [`PretrainOptions::bank_size`] says nothing then.
    #[must_use]
    pub(crate) fn with_bank(self, bank: GivenBank<'a>) -> Self {
        Self {
            bank: Some(bank),
            ..self
        }
    }

    /// Keeps the state of the training so often, instead of each 10 s.
    #[must_use]
    pub fn with_checkpoints(self, every: Duration) -> Self {
        Self { every, ..self }
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
        let manifest = self.manifest()?;
        let place = beside(path);
        sweep_beside(path);
        if path.symlink_metadata().is_ok() && WorkFolder::resume(&place, &manifest).is_err() {
            let problem = "exists already; choose another name, or remove it";
            return Err(EstimatorError::file(path, problem));
        }
        let folder = WorkFolder::open::<EstimatorError>(&place, &manifest, &[], |_| Ok(()))?;
        let lock = folder.lock()?;
        let made = self.made(&folder, progress).and_then(|made| {
            made.0.save_again(path)?;
            Ok(made)
        });
        drop(lock);
        match &made {
            Ok(_) => folder.remove()?,
            // It would only stand in the way of the next call. What is wrong is said, not that it cannot be removed either.
            Err(error) if ends_for_good(error) || is_bare(&folder) => drop(folder.remove()),
            Err(_) => {}
        }
        made
    }

    /// The estimator, by what is in the folder and what is still to be done.
    fn made(
        &self,
        folder: &WorkFolder,
        progress: &Progress,
    ) -> Result<(Estimator, History), EstimatorError> {
        let checkpoints = Checkpoints::new(folder.file(TRAINING), self.every);
        // What the network cannot take is said before anything is simulated.
        let plan = PretrainPlan::new(&self.project, self.sized())?;
        let simulated;
        let bank = match &self.bank {
            Some(given) => given.bank,
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
        let given = self.bank.as_ref().map(|given| given.bank.rows());
        PretrainOptions {
            bank_size: given.or(self.options.bank_size),
            ..self.options
        }
    }

    /// Everything that the estimator depends on.
    fn manifest(&self) -> Result<Manifest, EstimatorError> {
        let preset = self.project.recipe(self.options.preset);
        let settings = PretrainPlan::new(&self.project, self.sized())?.settings;
        let bank = match &self.bank {
            Some(given) => given.checksum.clone(),
            None => "simulated".into(),
        };
        Ok(self
            .project
            .study()
            .manifest(VERB, LAYOUT)?
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

/// Where the work on the estimator at `path` is kept.
fn beside(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(ENDING);
    name.into()
}

debug_by_name!(Pretraining<'_>, GivenBank<'_>);
