//! One file for an estimator: weights, scalers, study, recipe, seed, checksum.
//!
//! The file is a [safetensors](https://github.com/huggingface/safetensors) container, so other programs can read the
//! weights; what is not a tensor stands as one JSON text under the metadata key `truetwin`. The SHA-256 of that text
//! (checksum empty) and of all tensors is checked before anything is used. It holds data only, never code.

use super::calibration::Calibration;
use super::readout::Readout;
use super::{Estimator, PresetName, Project, Scaler, Settings, Standardiser};
use crate::feature::{FeatureError, FeatureRecipe};
use crate::network::{NamedTensor, NetworkError, bytes_of, values_of};
use crate::setting::did_you_mean;
use crate::storage::files::{replace, with_remedy, write_new};
use crate::storage::untrusted::{MESSAGE, one_line, read};
use crate::study::{StudyError, StudyFile, StudyFileError};
use ndarray::Array2;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Layout of the file; raised when it changes.
const SCHEMA: u32 = 2;
/// Longest file, in bytes: a network of 250 million weights.
const MOST: u64 = 1 << 30;
/// Key of the JSON text in the container's metadata.
const KEY: &str = "truetwin";
/// Prefix of the network's tensors.
const NETWORK: &str = "network/";

/// What is not a tensor.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    schema: u32,
    study: String,
    names: Vec<String>,
    preset: PresetName,
    features: Arc<dyn FeatureRecipe>,
    architecture: String,
    settings: Settings,
    inputs: usize,
    outputs: usize,
    /// Largest network input; none if unlimited.
    limit: Option<f64>,
    seed: u64,
    sha256: String,
}

/// Why an estimator file cannot be used.
///
/// ```
/// use truetwin::estimator::{Estimator, EstimatorFileError};
///
/// let error = Estimator::load("no-such.est".as_ref(), &[]).unwrap_err();
/// assert!(matches!(error, EstimatorFileError::Io { .. }));
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EstimatorFileError {
    /// It cannot be read or written.
    #[error("{}: {}", path.display(), with_remedy(error))]
    Io {
        /// File.
        path: PathBuf,
        /// What the system said.
        error: std::io::Error,
    },
    /// It is something else, or cut off.
    #[error("{}: not a whole estimator file ({reason}); make one with `truetwin pretrain`", path.display())]
    Foreign {
        /// File.
        path: PathBuf,
        /// What does not fit.
        reason: String,
    },
    /// Its bytes were changed.
    #[error("{}: the checksum does not match, the file was altered; pretrain again", path.display())]
    Altered {
        /// File.
        path: PathBuf,
    },
    /// It was written by another version.
    #[error("{}: file schema {found}, this version reads {SCHEMA}; pretrain again with this version", path.display())]
    Schema {
        /// File.
        path: PathBuf,
        /// Schema found.
        found: u32,
    },
    /// Its twin is not among the known ones.
    #[error("{}: made for twin \"{twin}\"{}, known are {known}; use the program that has this twin, or name it with --program or --fmu", path.display(), did_you_mean(twin, known.split(", ")))]
    Twin {
        /// File.
        path: PathBuf,
        /// Twin of the file.
        twin: String,
        /// Known twins.
        known: String,
    },
    /// Its network is not among those of the twin's study.
    #[error("{}: made with network \"{architecture}\", which this program's study of the twin does not have; pretrain again", path.display())]
    Architecture {
        /// File.
        path: PathBuf,
        /// Network of the file.
        architecture: String,
    },
    /// The twin has changed since.
    #[error("{}: made for parameters {file}, the twin now has {twin}; pretrain again", path.display())]
    Parameters {
        /// File.
        path: PathBuf,
        /// Parameters in the file.
        file: String,
        /// Parameters of the twin.
        twin: String,
    },
    /// Its features cannot be taken from the twin's records.
    #[error("{}: {error}", path.display())]
    Features {
        /// File.
        path: PathBuf,
        /// Reason.
        error: FeatureError,
    },
    /// Its study cannot be made.
    #[error("{}: {error}", path.display())]
    Study {
        /// File.
        path: PathBuf,
        /// Why.
        error: Box<StudyError>,
    },
}

/// Maps the errors of one file.
struct At<'a>(&'a Path);

impl At<'_> {
    fn io(&self, error: std::io::Error) -> EstimatorFileError {
        EstimatorFileError::Io {
            path: self.0.into(),
            error,
        }
    }
    fn foreign(&self, reason: impl ToString) -> EstimatorFileError {
        EstimatorFileError::Foreign {
            path: self.0.into(),
            reason: one_line(&reason.to_string(), MESSAGE),
        }
    }
    fn study(&self, error: impl Into<StudyError>) -> EstimatorFileError {
        EstimatorFileError::Study {
            path: self.0.into(),
            error: Box::new(error.into()),
        }
    }
}

impl Estimator {
    /// Writes a new file; it appears whole or not at all. The same estimator gives the same bytes.
    pub fn save(&self, path: &Path) -> Result<(), EstimatorFileError> {
        write_new(path, &self.bytes(path)?).map_err(|e| At(path).io(e))
    }

    /// As [`save`](Self::save), in place of a file that is there.
    pub(super) fn save_again(&self, path: &Path) -> Result<(), EstimatorFileError> {
        replace(path, &self.bytes(path)?).map_err(|e| At(path).io(e))
    }

    /// What the file at `path` holds.
    fn bytes(&self, path: &Path) -> Result<Vec<u8>, EstimatorFileError> {
        let at = At(path);
        let study = toml::to_string(self.study().file()).map_err(|e| at.foreign(e))?;
        let space = self.study().twin().parameters();
        let mut header = Header {
            schema: SCHEMA,
            study,
            names: space.names().into_iter().map(str::to_owned).collect(),
            preset: self.preset,
            features: self.recipe.clone(),
            architecture: self.architecture.id().into(),
            settings: self.settings.clone(),
            inputs: self.readout.network.inputs(),
            outputs: self.readout.network.outputs(),
            limit: Some(self.readout.inputs.limit).filter(|limit| limit.is_finite()),
            seed: self.seed,
            sha256: String::new(),
        };
        let tensors = self.tensors();
        header.sha256 = checksum(&header, &tensors).map_err(|e| at.foreign(e))?;
        let text = serde_json::to_string(&header).map_err(|e| at.foreign(e))?;
        let views: Vec<(&String, TensorView<'_>)> = (tensors.iter())
            .map(|(name, t)| {
                let view = TensorView::new(t.dtype, t.shape.clone(), &t.bytes);
                Ok((name, view.map_err(|e| at.foreign(format!("{e:?}")))?))
            })
            .collect::<Result<_, EstimatorFileError>>()?;
        let metadata = Some(HashMap::from([(KEY.to_owned(), text)]));
        safetensors::serialize(views, &metadata).map_err(|error| at.foreign(format!("{error:?}")))
    }

    /// Reads a file made for one of `known`, studies or projects.
    pub fn load<P>(path: &Path, known: &[P]) -> Result<Self, EstimatorFileError>
    where
        for<'a> &'a P: Into<Project>,
    {
        let known: Vec<Project> = known.iter().map(Into::into).collect();
        Self::load_known(path, &known)
    }

    fn load_known(path: &Path, known: &[Project]) -> Result<Self, EstimatorFileError> {
        let at = At(path);
        let bytes = read(path, MOST).map_err(|e| at.io(e))?;
        let (_, metadata) =
            SafeTensors::read_metadata(&bytes).map_err(|e| at.foreign(format!("{e:?}")))?;
        let text = (metadata.metadata().as_ref().and_then(|m| m.get(KEY)))
            .ok_or_else(|| at.foreign("no truetwin header"))?;
        let header = parse_header(&at, text)?;
        let container =
            SafeTensors::deserialize(&bytes).map_err(|e| at.foreign(format!("{e:?}")))?;
        let tensors: BTreeMap<String, RawTensor> = (container.tensors().into_iter())
            .map(|(name, view)| (name, RawTensor::of(&view)))
            .collect();
        let unsigned = Header {
            sha256: String::new(),
            ..header.clone()
        };
        if checksum(&unsigned, &tensors).ok().as_ref() != Some(&header.sha256) {
            return Err(EstimatorFileError::Altered { path: path.into() });
        }
        let file = StudyFile::parse(&header.study, path)
            .map_err(|error: StudyFileError| at.study(error))?;
        let Some(registered) = known.iter().find(|p| p.study().name() == file.twin) else {
            let known: Vec<_> = known.iter().map(|p| p.study().name()).collect();
            return Err(EstimatorFileError::Twin {
                path: path.into(),
                twin: one_line(&file.twin, MESSAGE),
                known: known.join(", "),
            });
        };
        let project = registered.configure(&file).map_err(|e| at.study(e))?;
        let study = project.study();
        let names = study.twin().parameters().names().join(", ");
        if names != header.names.join(", ") {
            return Err(EstimatorFileError::Parameters {
                path: path.into(),
                file: one_line(&header.names.join(", "), MESSAGE),
                twin: names,
            });
        }
        let Some(architecture) = project.architecture(&header.architecture) else {
            return Err(EstimatorFileError::Architecture {
                path: path.into(),
                architecture: one_line(&header.architecture, MESSAGE),
            });
        };
        // A network has a head for each parameter: no header may have any other number made.
        if header.outputs != header.names.len() {
            let (outputs, names) = (header.outputs, header.names.len());
            return Err(at.foreign(format!("{outputs} outputs for {names} parameters")));
        }
        let weights = weights(&tensors);
        let network = (architecture.restore(header.inputs, header.outputs, &weights))
            .map_err(|error: NetworkError| at.foreign(error))?;
        let map =
            (header.features.bind(study.twin())).map_err(|error| EstimatorFileError::Features {
                path: path.into(),
                error,
            })?;
        if map.dim() != header.inputs {
            let reason = format!(
                "{} features, the network reads {}",
                map.dim(),
                header.inputs
            );
            return Err(at.foreign(reason));
        }
        let matrix = |name: &str| -> Result<Array2<f64>, EstimatorFileError> {
            (tensors.get(name).and_then(RawTensor::matrix))
                .ok_or_else(|| at.foreign(format!("tensor {name} is missing or misshapen")))
        };
        let row = |name: &str, width: usize| -> Result<Vec<f64>, EstimatorFileError> {
            let values = matrix(name)?;
            match values.dim() {
                (1, n) if n == width => Ok(values.into_iter().collect()),
                shape => Err(at.foreign(format!("tensor {name} is {shape:?}"))),
            }
        };
        let features = Standardiser {
            mean: row("features.mean", header.inputs)?,
            matrix: matrix("features.matrix")?,
            limit: header.limit.unwrap_or(f64::INFINITY),
        };
        if features.matrix.dim() != (header.inputs, header.inputs) {
            let shape = features.matrix.dim();
            return Err(at.foreign(format!("tensor features.matrix is {shape:?}")));
        }
        let targets = Scaler {
            mean: row("targets.mean", header.outputs)?,
            scale: row("targets.scale", header.outputs)?,
        };
        let calibration = Calibration {
            predicted: matrix("calibration.predicted")?,
            truth: matrix("calibration.truth")?,
        };
        let pairs = calibration.truth.nrows();
        if calibration.predicted.dim() != (pairs, header.outputs)
            || calibration.truth.ncols() != header.outputs
        {
            return Err(at.foreign("calibration tensors do not fit each other"));
        }
        Ok(Self {
            readout: Readout {
                inputs: features,
                targets,
                layer: None,
                network,
            },
            calibration,
            preset: header.preset,
            settings: header.settings,
            recipe: header.features,
            seed: header.seed,
            architecture,
            project,
        })
    }

    /// Weights, scalers and calibration by name.
    fn tensors(&self) -> BTreeMap<String, RawTensor> {
        let mut tensors = BTreeMap::new();
        for tensor in self.readout.network.weights() {
            tensors.insert(
                format!("{NETWORK}{}", tensor.name),
                RawTensor {
                    dtype: Dtype::F32,
                    shape: tensor.shape,
                    bytes: bytes_of(&tensor.values),
                },
            );
        }
        let mut put = |name: &str, rows: usize, values: Vec<f64>| {
            tensors.insert(
                name.to_owned(),
                RawTensor {
                    dtype: Dtype::F64,
                    shape: vec![rows, values.len() / rows.max(1)],
                    bytes: values.iter().flat_map(|v| v.to_le_bytes()).collect(),
                },
            );
        };
        put("features.mean", 1, self.readout.inputs.mean.clone());
        let matrix = &self.readout.inputs.matrix;
        put(
            "features.matrix",
            matrix.nrows(),
            matrix.iter().copied().collect(),
        );
        put("targets.mean", 1, self.readout.targets.mean.clone());
        put("targets.scale", 1, self.readout.targets.scale.clone());
        let Calibration { predicted, truth } = &self.calibration;
        for (what, matrix) in [("predicted", predicted), ("truth", truth)] {
            let values = matrix.iter().copied().collect();
            put(&format!("calibration.{what}"), matrix.nrows(), values);
        }
        tensors
    }
}

/// Reads the header, telling another schema from a foreign file.
fn parse_header(at: &At<'_>, text: &str) -> Result<Header, EstimatorFileError> {
    let value: serde_json::Value = serde_json::from_str(text).map_err(|e| at.foreign(e))?;
    match value.get("schema").and_then(serde_json::Value::as_u64) {
        Some(schema) if schema == u64::from(SCHEMA) => {
            serde_json::from_value(value).map_err(|e| at.foreign(e))
        }
        Some(schema) => Err(EstimatorFileError::Schema {
            path: at.0.into(),
            found: u32::try_from(schema).unwrap_or(u32::MAX),
        }),
        None => Err(at.foreign("its header has no schema")),
    }
}

/// The network's tensors among all.
fn weights(tensors: &BTreeMap<String, RawTensor>) -> Vec<NamedTensor> {
    (tensors.iter())
        .filter_map(|(name, tensor)| {
            Some(NamedTensor {
                name: name.strip_prefix(NETWORK)?.to_owned(),
                shape: tensor.shape.clone(),
                values: values_of(&tensor.bytes),
            })
        })
        .collect()
}

/// A tensor as it lies in the file.
struct RawTensor {
    dtype: Dtype,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

impl RawTensor {
    fn of(view: &TensorView<'_>) -> Self {
        Self {
            dtype: view.dtype(),
            shape: view.shape().to_vec(),
            bytes: view.data().to_vec(),
        }
    }

    fn matrix(&self) -> Option<Array2<f64>> {
        let (&[rows, columns], Dtype::F64) = (self.shape.as_slice(), self.dtype) else {
            return None;
        };
        let values = (self.bytes.chunks_exact(8))
            .map(|b| b.try_into().map(f64::from_le_bytes))
            .collect::<Result<Vec<f64>, _>>()
            .ok()?;
        let matrix = Array2::from_shape_vec((rows, columns), values).ok()?;
        matrix.iter().all(|v| v.is_finite()).then_some(matrix)
    }
}

/// SHA-256 over the header without checksum and every tensor, in the order of names.
fn checksum(
    header: &Header,
    tensors: &BTreeMap<String, RawTensor>,
) -> Result<String, serde_json::Error> {
    let mut hash = Sha256::new();
    hash.update(serde_json::to_string(header)?);
    for (name, tensor) in tensors {
        hash.update(format!("\n{name} {:?} {:?}\n", tensor.dtype, tensor.shape));
        hash.update(&tensor.bytes);
    }
    Ok(hash.finalize().iter().map(|b| format!("{b:02x}")).collect())
}
