//! What a bank on disk holds, and who fills it.

use super::folder::{SHARDS, ShardedBank, Shards};
use super::{Prior, ShardsError};
use crate::estimator::bank::BankError;
use crate::estimator::bank::file::{BankFileError, npz};
use crate::estimator::{PresetName, Project};
use crate::progress::Progress;
use crate::storage::work::{Manifest, Share, WorkFolder};
use serde_json::json;
use std::path::Path;

/// Layout of the folder; raised when it changes.
const LAYOUT: u32 = 2;
pub(super) const VERB: &str = "bank";
/// Most simulations of a bank.
pub(super) const MOST: usize = 1_000_000_000_000;
/// About so many shards make a bank, unless they would be smaller or larger than this.
const SHARES: usize = 64;
const FEWEST_ROWS: usize = 16;
const MOST_ROWS: usize = 16_384;

/// A bank to be filled: simulations from a study's prior, as features of a preset.
///
/// ```
/// use truetwin::estimator::bank::Bank;
/// use truetwin::evaluate::paper::reference_studies;
/// use truetwin::progress::Progress;
/// use truetwin::estimator::shards::{BankPlan, ShardedBank};
/// use truetwin::estimator::{PresetName, Project};
///
/// let project = Project::from(&reference_studies()?[0]);
/// let plan = BankPlan { project, preset: PresetName::Paper, size: 40, seed: 1 };
/// let place = tempfile::tempdir()?;
/// let folder = place.path().join("bank");
/// // Two jobs of an array, one after the other, in any order.
/// plan.fill(&folder, "1/2".parse()?, &Progress::silent())?;
/// let filled = plan.fill(&folder, "2/2".parse()?, &Progress::silent())?;
/// assert_eq!((filled.there, filled.of), (3, 3));
/// assert_eq!(ShardedBank::open(&folder)?.rows(), 40);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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

/// How far a bank on disk has come.
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

/// Rows of each shard of a bank, the last one excepted: a function of its size alone.
pub(super) fn rows_of_a_shard(size: usize) -> usize {
    size.div_ceil(SHARES).clamp(FEWEST_ROWS, MOST_ROWS)
}

impl BankPlan {
    /// Simulates the shards of a share that are not in the folder yet; makes the folder where there is none.
    ///
    /// Shards that are there are read once: one that is not what it was is made again. Several processes may fill one
    /// folder; each shard appears whole.
    ///
    /// # Errors
    ///
    /// [`ShardsError`]: a folder of another call, a place that cannot be written, a twin that fails, a stop.
    pub fn fill(
        &self,
        path: &Path,
        share: Share,
        progress: &Progress,
    ) -> Result<Filled, ShardsError> {
        if !(1..=MOST).contains(&self.size) {
            return Err(ShardsError::Size(self.size));
        }
        let prior = Prior::new(
            self.project.study(),
            self.project.recipe(self.preset).features.as_ref(),
        )?;
        let manifest = self.manifest()?;
        let folder = WorkFolder::open::<ShardsError>(path, &manifest, &[SHARDS], |_| Ok(()))?;
        let shards = Shards::list(folder, manifest.clone())?;
        let mine = || (0..shards.of).filter(|number| share.takes(*number));
        let stage = progress.stage("kept shards", mine().count());
        let mut missing = Vec::new();
        for number in mine() {
            if !shards.is_sound(number)? {
                shards.remove(number)?;
                missing.push(number);
            }
            stage.tick().map_err(BankError::from)?;
        }
        let rows: usize = missing.iter().map(|n| shards.rows(*n).count()).sum();
        let stage = progress.stage("bank", rows);
        for number in missing {
            let draws = prior.rows(shards.rows(number), self.seed, "bank", &stage)?;
            let bytes = npz(&draws).map_err(|error| BankFileError::io(path, error))?;
            shards.add(number, &bytes)?;
        }
        finish(path, manifest)
    }

    /// How far the folder has come; one that is whole gets the checksums of its shards.
    ///
    /// # Errors
    ///
    /// [`ShardsError`]: no folder of this call.
    pub fn finish(&self, path: &Path) -> Result<Filled, ShardsError> {
        finish(path, self.manifest()?)
    }

    /// Everything that the rows depend on.
    pub(super) fn manifest(&self) -> Result<Manifest, ShardsError> {
        let features = &self.project.recipe(self.preset).features;
        Ok((self.project.study())
            .manifest(VERB, LAYOUT)?
            .with("size", self.size)
            .with("rows of a shard", rows_of_a_shard(self.size))
            .with("seed", self.seed)
            .with("features", json!(features)))
    }

    /// Whether a bank was made as this plan says.
    ///
    /// # Errors
    ///
    /// [`ShardsError::Other`] names what is different.
    pub fn check(&self, bank: &ShardedBank) -> Result<(), ShardsError> {
        match self.manifest()?.differs(bank.manifest()) {
            None => Ok(()),
            Some(difference) => Err(ShardsError::Other {
                path: bank.path().into(),
                difference,
            }),
        }
    }
}

/// How far a folder of this manifest has come, which takes a simulation to make.
fn finish(path: &Path, manifest: Manifest) -> Result<Filled, ShardsError> {
    let shards = Shards::list(WorkFolder::resume(path, &manifest)?, manifest)?;
    shards.finish()?;
    Ok(Filled {
        there: shards.there.len(),
        of: shards.of,
        rows: shards.there.keys().map(|n| shards.rows(*n).count()).sum(),
    })
}
