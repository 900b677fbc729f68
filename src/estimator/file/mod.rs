//! One file for an estimator: weights, scalers, study, recipe, seed, checksum.
//!
//! The file is a [safetensors](https://github.com/huggingface/safetensors) container, so other programs can read the
//! weights; the rest is one JSON text under the metadata key `truetwin`. The SHA-256 of that text
//! (checksum empty) and of all tensors is checked before anything is used. It holds data only, never code.

mod header;
mod tensors;

use crate::estimator::error::EstimatorError;
use crate::estimator::estimator::Estimator;
use crate::estimator::project::Project;
use crate::estimator::readout::Readout;
use crate::network::Architecture;
use crate::storage::files::{replace, write_new};
use crate::storage::untrusted::read;
use crate::study::StudyFile;
use header::{Header, foreign, not_whole};
use safetensors::tensor::{SafeTensorError, SafeTensors};
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;
use tensors::Tensors;

/// Longest file, in bytes: a network of 250 million weights.
const LONGEST: u64 = 1 << 30;
/// Key of the header in the container's metadata.
const KEY: &str = "truetwin";

impl Estimator {
    /// Writes a new file; it appears whole or not at all. The same estimator gives the same bytes.
    pub fn save(&self, path: &Path) -> Result<(), EstimatorError> {
        let bytes = bytes(self).map_err(|problem| EstimatorError::file(path, problem))?;
        write_new(path, &bytes).map_err(|error| EstimatorError::io(path, error))
    }

    /// As [`save`](Self::save), in place of a file that is there.
    pub(super) fn save_again(&self, path: &Path) -> Result<(), EstimatorError> {
        let bytes = bytes(self).map_err(|problem| EstimatorError::file(path, problem))?;
        replace(path, &bytes).map_err(|error| EstimatorError::io(path, error))
    }

    /// Reads a file made for one of `known`, studies or projects.
    pub fn load<P>(path: &Path, known: &[P]) -> Result<Self, EstimatorError>
    where
        for<'a> &'a P: Into<Project>,
    {
        let known: Vec<Project> = known.iter().map(Into::into).collect();
        let bytes = read(path, LONGEST).map_err(|error| EstimatorError::io(path, error))?;
        restored(&bytes, path, &known).map_err(|problem| EstimatorError::file(path, problem))
    }
}

/// The bytes of an estimator's file.
fn bytes(estimator: &Estimator) -> Result<Vec<u8>, String> {
    let tensors = Tensors::of(estimator);
    let header = Header::of(estimator, &tensors)?;
    let text = serde_json::to_string(&header).map_err(|error| error.to_string())?;
    let metadata = Some(HashMap::from([(KEY.to_owned(), text)]));
    safetensors::serialize(tensors.views()?, &metadata).map_err(|error| format!("{error:?}"))
}

/// The estimator in the bytes of a file.
fn restored(bytes: &[u8], path: &Path, known: &[Project]) -> Result<Estimator, String> {
    let (header, tensors) = intact(bytes)?;
    let project = project(&header, path, known)?;
    let architecture = architecture(&header, &project)?;
    let (n, d) = (header.inputs, header.outputs);
    let network = (architecture.restore(n, d, &tensors.weights()))
        .map_err(|error| not_whole(&error.to_string()))?;
    let map = header.features.bind(project.study().twin());
    let width = map.map_err(|error| error.to_string())?.dim();
    if width != n {
        let reason = format!("{width} features, the network reads {n}");
        return Err(not_whole(&reason));
    }
    let limit = header.limit.unwrap_or(f64::INFINITY);
    let damaged = |reason: String| not_whole(&reason);
    Ok(Estimator {
        readout: Readout {
            inputs: tensors.inputs(n, limit).map_err(damaged)?,
            targets: tensors.targets(d).map_err(damaged)?,
            layer: None,
            network,
        },
        calibration: tensors.calibration(d).map_err(damaged)?,
        preset: header.preset,
        settings: header.settings,
        recipe: header.features,
        seed: header.seed,
        architecture,
        project,
    })
}

/// Header and tensors, their checksum compared.
fn intact(bytes: &[u8]) -> Result<(Header, Tensors), String> {
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(unread)?;
    let text = (metadata.metadata().as_ref().and_then(|m| m.get(KEY))).ok_or_else(foreign)?;
    let header = Header::parse(text)?;
    let tensors = Tensors::read(&SafeTensors::deserialize(bytes).map_err(unread)?);
    if header.is_intact(&tensors) {
        Ok((header, tensors))
    } else {
        Err("the checksum does not match, the file was altered; pretrain again".into())
    }
}

/// The problem of a container that cannot be read.
fn unread(error: SafeTensorError) -> String {
    use SafeTensorError as E;
    match error {
        E::HeaderTooSmall
        | E::HeaderTooLarge
        | E::InvalidHeader
        | E::InvalidHeaderStart
        | E::InvalidHeaderDeserialization => foreign(),
        E::InvalidHeaderLength | E::MetadataIncompleteBuffer => not_whole("it is cut off"),
        _ => not_whole("its tensors are damaged"),
    }
}

/// The known project of the file's twin, in the file's setting.
fn project(header: &Header, path: &Path, known: &[Project]) -> Result<Project, String> {
    let file = StudyFile::parse(&header.study, path).map_err(|error| error.to_string())?;
    let registered = known.iter().find(|p| p.study().name() == file.twin);
    let registered = registered.ok_or_else(|| {
        let known: Vec<_> = known.iter().map(|p| p.study().name()).collect();
        format!(
            "made for twin \"{}\", known are {}; use the program that has this twin",
            file.twin,
            known.join(", ")
        )
    })?;
    let project = (registered.configure(&file)).map_err(|error| error.to_string())?;
    let names = project.study().twin().parameters().names().join(", ");
    let made_for = header.names.join(", ");
    if names != made_for {
        return Err(format!(
            "made for parameters {made_for}, the twin now has {names}; pretrain again"
        ));
    }
    Ok(project)
}

/// The file's network among those of the project; it has a head for each parameter.
fn architecture(header: &Header, project: &Project) -> Result<Arc<dyn Architecture>, String> {
    let id = &header.architecture;
    let architecture = project.architecture(id).ok_or_else(|| {
        format!(
            "made with network \"{id}\", which this program's study of the twin does not have; pretrain again"
        )
    })?;
    let (outputs, names) = (header.outputs, header.names.len());
    if outputs == names {
        Ok(architecture)
    } else {
        Err(not_whole(&format!(
            "{outputs} outputs for {names} parameters"
        )))
    }
}
