//! Header of an estimator file: everything but the tensors, as JSON.

use super::tensors::Tensors;
use crate::estimator::estimator::Estimator;
use crate::estimator::recipe::PresetName;
use crate::estimator::settings::Settings;
use crate::feature::FeatureRecipe;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::sync::Arc;

/// Layout of the file; raised when it changes.
const SCHEMA: u32 = 2;

/// The problem of a file that is something else, or cut off.
pub(super) fn not_whole(reason: &str) -> String {
    format!("not a whole estimator file ({reason}); pretrain one again")
}

/// The problem of a file of another kind.
pub(super) fn foreign() -> String {
    "not an estimator file; give one that was pretrained".into()
}

/// The header. The order of its fields is part of the format.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Header {
    schema: u32,
    /// The study file's text.
    pub study: String,
    /// Names of the parameters.
    pub names: Vec<String>,
    pub preset: PresetName,
    pub features: Arc<dyn FeatureRecipe>,
    /// The network's id.
    pub architecture: String,
    pub settings: Settings,
    /// Number of features.
    pub inputs: usize,
    /// Number of parameters.
    pub outputs: usize,
    /// Largest network input; none if unlimited.
    pub limit: Option<f64>,
    pub seed: u64,
    sha256: String,
}

impl Header {
    /// The header of an estimator with these tensors.
    pub fn of(estimator: &Estimator, tensors: &Tensors) -> Result<Self, String> {
        let study = estimator.study();
        let space = study.twin().parameters();
        let mut header = Self {
            schema: SCHEMA,
            study: toml::to_string(study.file()).map_err(|error| error.to_string())?,
            names: space.names().into_iter().map(str::to_owned).collect(),
            preset: estimator.preset,
            features: estimator.recipe.clone(),
            architecture: estimator.architecture.id().into(),
            settings: estimator.settings.clone(),
            inputs: estimator.readout.network.inputs(),
            outputs: estimator.readout.network.outputs(),
            limit: Some(estimator.readout.inputs.limit).filter(|limit| limit.is_finite()),
            seed: estimator.seed,
            sha256: String::new(),
        };
        header.sha256 = header.checksum(tensors)?;
        Ok(header)
    }

    /// Parses a header; a header of another schema is told from foreign text.
    pub fn parse(text: &str) -> Result<Self, String> {
        let whole = |reason: String| not_whole(&reason);
        let value: serde_json::Value =
            serde_json::from_str(text).map_err(|error| whole(error.to_string()))?;
        match value.get("schema").and_then(serde_json::Value::as_u64) {
            Some(schema) if schema == u64::from(SCHEMA) => {
                serde_json::from_value(value).map_err(|error| whole(error.to_string()))
            }
            Some(schema) => Err(format!(
                "file schema {schema}, this version reads {SCHEMA}; pretrain again with this version"
            )),
            None => Err(whole("its header has no schema".into())),
        }
    }

    /// Returns whether header and tensors are those that were written.
    pub fn is_intact(&self, tensors: &Tensors) -> bool {
        self.checksum(tensors).is_ok_and(|sum| sum == self.sha256)
    }

    /// SHA-256 of the header without checksum, and of every tensor.
    fn checksum(&self, tensors: &Tensors) -> Result<String, String> {
        let unsigned = Self {
            sha256: String::new(),
            ..self.clone()
        };
        let text = serde_json::to_string(&unsigned).map_err(|error| error.to_string())?;
        let mut hash = Sha256::new();
        hash.update(text);
        tensors.hash(|bytes| hash.update(bytes));
        Ok(hash.finalize().iter().map(|b| format!("{b:02x}")).collect())
    }
}
