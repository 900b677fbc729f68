//! Plan of a bank on disk.

use super::folder::{SHARDS, ShardedBank, Shards, VERB, rows_of_a_shard};
use crate::estimator::bank::Prior;
use crate::estimator::bank::file::npz;
use crate::estimator::error::EstimatorError;
use crate::estimator::project::Project;
use crate::estimator::recipe::PresetName;
use crate::estimator::settings::MOST_SIMULATIONS;
use crate::progress::Progress;
use crate::storage::work::{Manifest, Share, WorkFolder};
use serde_json::json;
use std::path::Path;

/// Layout of the folder; raised when it changes.
const LAYOUT: u32 = 2;

/// A bank to be filled: simulations from a study's prior, as features of a preset.
#[derive(Debug, Clone)]
pub struct BankPlan {
    /// Twin, prior, records.
    pub project: Project,
    /// Whose features.
    pub preset: PresetName,
    /// Simulations, M.
    pub size: usize,
    /// Row i depends on it and i alone.
    pub seed: u64,
}

/// Progress of a bank on disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Filled {
    /// Shards in the folder.
    pub there: usize,
    /// Shards of the whole bank.
    pub of: usize,
    /// Simulations in the folder.
    pub rows: usize,
}

impl BankPlan {
    /// Simulates the shards of a share that are not in the folder yet; makes the folder where there is none.
    ///
    /// Shards that are there are read once: one that is not what it was is made again. Several processes may fill one
    /// folder; each shard appears whole.
    pub fn fill(
        &self,
        path: &Path,
        share: Share,
        progress: &Progress,
    ) -> Result<Filled, EstimatorError> {
        if !(1..=MOST_SIMULATIONS).contains(&self.size) {
            return Err(EstimatorError::Bank(format!(
                "a bank of {} simulations; choose between 1 and {MOST_SIMULATIONS}",
                self.size
            )));
        }
        let prior = Prior::new(
            self.project.study(),
            self.project.recipe(self.preset).features.as_ref(),
        )?;
        let manifest = self.manifest()?;
        let folder = WorkFolder::open::<EstimatorError>(path, &manifest, &[SHARDS], |_| Ok(()))?;
        let shards = Shards::list(folder, manifest.clone())?;
        let mine = || (0..shards.of).filter(|number| share.takes(*number));
        let stage = progress.stage("kept shards", mine().count());
        let mut missing = Vec::new();
        for number in mine() {
            if !shards.is_sound(number)? {
                shards.remove(number)?;
                missing.push(number);
            }
            stage.tick()?;
        }
        let rows: usize = missing.iter().map(|n| shards.rows(*n).count()).sum();
        let stage = progress.stage("bank", rows);
        for number in missing {
            let draws = prior.rows(shards.rows(number), self.seed, "bank", &stage)?;
            let bytes = npz(&draws).map_err(|error| EstimatorError::io(path, error))?;
            shards.add(number, &bytes)?;
        }
        finish(path, manifest)
    }

    /// Returns the progress of the folder; a complete one gets the checksums of its shards.
    pub fn finish(&self, path: &Path) -> Result<Filled, EstimatorError> {
        finish(path, self.manifest()?)
    }

    /// Everything that the rows depend on.
    pub(super) fn manifest(&self) -> Result<Manifest, EstimatorError> {
        let features = &self.project.recipe(self.preset).features;
        Ok((self.project.study())
            .manifest(VERB, LAYOUT)?
            .with("size", self.size)
            .with("rows of a shard", rows_of_a_shard(self.size))
            .with("seed", self.seed)
            .with("features", json!(features)))
    }

    /// Checks whether a bank was made as this plan says.
    pub fn check(&self, bank: &ShardedBank) -> Result<(), EstimatorError> {
        match self.manifest()?.differs(bank.manifest()) {
            None => Ok(()),
            Some(difference) => {
                let problem =
                    format!("a bank of another setting: {difference}; make a bank with this one");
                Err(EstimatorError::file(bank.path(), problem))
            }
        }
    }
}

/// Returns the progress of a folder; the manifest takes one simulation to make.
fn finish(path: &Path, manifest: Manifest) -> Result<Filled, EstimatorError> {
    let shards = Shards::list(WorkFolder::resume(path, &manifest)?, manifest)?;
    shards.finish()?;
    Ok(Filled {
        there: shards.there.len(),
        of: shards.of,
        rows: shards.there.keys().map(|n| shards.rows(*n).count()).sum(),
    })
}
