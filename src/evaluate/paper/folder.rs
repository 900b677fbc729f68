//! The folder of a study of many records.

use super::monte_carlo::{MonteCarlo, RUNS};
use crate::estimator::{PretrainOptions, Recipe};
use crate::storage::StorageError;
use crate::storage::work::{Manifest, WorkFolder, checksum};
use crate::study::Study;
use serde_json::json;
use std::path::Path;

/// Layout of the folder; raised when it changes.
const LAYOUT: u32 = 3;

/// Source of a study's estimator.
#[derive(Debug, Clone, Copy)]
pub enum Origin<'a> {
    /// Trained for it, and kept in the folder.
    Trained(&'a Recipe, &'a PretrainOptions),
    /// From a file.
    File(&'a Path),
}

impl MonteCarlo {
    /// A folder for the runs of this plan over `study`, a new one or the one of the same call: `runs/0000.json`, … hold a
    /// [`BenchmarkRun`](super::Run) each; `estimator.est` is for an estimator that is trained for the study.
    pub(crate) fn folder(
        &self,
        path: &Path,
        study: &Study,
        origin: Origin<'_>,
    ) -> Result<WorkFolder, StorageError> {
        let manifest = self.manifest(study, origin)?;
        WorkFolder::open(path, &manifest, &[RUNS], |_| Ok(()))
    }

    /// Everything that the runs depend on; files by their checksums.
    fn manifest(&self, study: &Study, origin: Origin<'_>) -> Result<Manifest, StorageError> {
        let manifest = study
            .manifest("reproduce", LAYOUT)?
            .with("scenario", self.scenario.number())
            .with("runs", self.runs)
            .with("seed", self.seed);
        Ok(match origin {
            Origin::File(path) => manifest.with("estimator", checksum(path)?),
            Origin::Trained(recipe, options) => manifest
                .with("preset", options.preset.to_string())
                .with("bank size", options.bank_size)
                .with("epochs", options.epochs)
                .with("training seed", options.seed)
                .with("network", recipe.architecture.id())
                .with("features", json!(recipe.features))
                .with("preset settings", json!(recipe.settings)),
        })
    }
}
