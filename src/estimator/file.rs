//! One file for an estimator: weights, scalers, study, recipe, seed, checksum.
//!
//! The file is a [safetensors](https://github.com/huggingface/safetensors) container, so other programs can read the
//! weights; the rest is one JSON text under the metadata key `truetwin`. The SHA-256 of that text
//! (checksum empty) and of all tensors is checked before anything is used. It holds data only, never code.

use crate::estimator::error::EstimatorError;
use crate::estimator::estimator::Estimator;
use crate::estimator::project::PresetName;
use crate::estimator::project::Project;
use crate::estimator::readout::{Calibration, Readout, Scaler, Standardiser};
use crate::estimator::settings::Settings;
use crate::feature::FeatureRecipe;
use crate::math::one_row;
use crate::network::{Architecture, NamedTensor, bytes_of, values_of};
use crate::setting::count;
use crate::storage::checksum::sha256;
use crate::storage::files::{replace, write_new};
use crate::storage::untrusted::{message, read};
use crate::study::{Study, StudyFile};
use ndarray::Array2;
use safetensors::tensor::{Dtype, SafeTensorError, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap};
use std::io;
use std::path::Path;
use std::sync::Arc;

/// Layout of the file; raised when it changes.
const SCHEMA: u32 = 2;
/// Longest file, in bytes: a network of 250 million weights.
const LONGEST: u64 = 1 << 30;
/// Key of the header in the container's metadata.
const KEY: &str = "truetwin";
/// Prefix of the network's tensors.
const NETWORK: &str = "network/";

impl Estimator {
    /// Writes a new file; it appears whole or not at all. The same estimator gives the same bytes.
    pub fn save(&self, path: &Path) -> Result<(), EstimatorError> {
        self.write(path, write_new)
    }

    /// As [`save`](Self::save), in place of a file that is there.
    pub(super) fn save_again(&self, path: &Path) -> Result<(), EstimatorError> {
        self.write(path, replace)
    }

    fn write(
        &self,
        path: &Path,
        write: fn(&Path, &[u8]) -> io::Result<()>,
    ) -> Result<(), EstimatorError> {
        let bytes = bytes(self).map_err(|problem| EstimatorError::file(path, problem))?;
        write(path, &bytes).map_err(|error| EstimatorError::io(path, error))
    }

    /// Reads a file made for one of `known`, studies or projects.
    pub fn load<P>(path: &Path, known: &[P]) -> Result<Self, EstimatorError>
    where
        for<'a> &'a P: Into<Project>,
    {
        let known: Vec<Project> = known.iter().map(Into::into).collect();
        let bytes = read(path, LONGEST).map_err(|error| EstimatorError::io(path, error))?;
        restored(&bytes, path, &known).map_err(|problem| EstimatorError::NoEstimator {
            path: path.into(),
            problem: message(&problem),
        })
    }
}

/// Everything but the tensors, as JSON. The order of the fields is part of the format.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    schema: u32,
    /// The study file's text.
    study: String,
    /// Names of the parameters.
    names: Vec<String>,
    preset: PresetName,
    features: Arc<dyn FeatureRecipe>,
    /// The network's id.
    architecture: String,
    settings: Settings,
    /// Number of features.
    inputs: usize,
    /// Number of parameters.
    outputs: usize,
    /// Largest network input; none if unlimited.
    limit: Option<f64>,
    seed: u64,
    sha256: String,
}

impl Header {
    /// Parses a header; a header of another schema is told from foreign text.
    fn parse(text: &str) -> Result<Self, String> {
        let whole = |error: serde_json::Error| not_whole(&error.to_string());
        let value: serde_json::Value = serde_json::from_str(text).map_err(whole)?;
        match value.get("schema").and_then(serde_json::Value::as_u64) {
            Some(schema) if schema == u64::from(SCHEMA) => {
                serde_json::from_value(value).map_err(whole)
            }
            Some(schema) => Err(format!(
                "file schema {schema}, this version reads {SCHEMA}; pretrain again with this version"
            )),
            None => Err(not_whole("its header has no schema")),
        }
    }

    /// SHA-256 of the header without checksum, and of every tensor.
    fn checksum(&self, tensors: &Tensors<'_>) -> Result<String, String> {
        let unsigned = Self {
            sha256: String::new(),
            ..self.clone()
        };
        let mut all = serde_json::to_vec(&unsigned).map_err(|error| error.to_string())?;
        for (name, tensor) in tensors {
            let (dtype, shape) = (tensor.dtype(), tensor.shape());
            all.extend(format!("\n{name} {dtype:?} {shape:?}\n").bytes());
            all.extend(tensor.data());
        }
        Ok(sha256(&all))
    }
}

/// Tensors of a file by name: the network's, of 32 bits, scalers and calibration, of 64.
type Tensors<'a> = BTreeMap<String, TensorView<'a>>;

/// The bytes of an estimator's file.
fn bytes(estimator: &Estimator) -> Result<Vec<u8>, String> {
    let (study, readout) = (estimator.study(), &estimator.readout);
    let calibration = &estimator.calibration;
    let mut raw: Vec<(String, Dtype, Vec<usize>, Vec<u8>)> = Vec::new();
    for tensor in readout.network.weights() {
        let name = format!("{NETWORK}{}", tensor.name);
        raw.push((name, Dtype::F32, tensor.shape, bytes_of(&tensor.values)));
    }
    for (name, matrix) in [
        ("features.mean", &one_row(&readout.inputs.mean)),
        ("targets.mean", &one_row(&readout.targets.mean)),
        ("targets.scale", &one_row(&readout.targets.scale)),
        ("features.matrix", &readout.inputs.matrix),
        ("calibration.predicted", &calibration.predicted),
        ("calibration.truth", &calibration.truth),
    ] {
        let bytes = matrix.iter().flat_map(|v| v.to_le_bytes()).collect();
        raw.push((name.to_owned(), Dtype::F64, matrix.shape().to_vec(), bytes));
    }
    let tensors = (raw.iter())
        .map(|(name, dtype, shape, bytes)| {
            let view = TensorView::new(*dtype, shape.clone(), bytes);
            Ok((name.clone(), view.map_err(|error| format!("{error:?}"))?))
        })
        .collect::<Result<Tensors<'_>, String>>()?;
    let space = study.twin().parameters();
    let mut header = Header {
        schema: SCHEMA,
        study: study.file().written().map_err(|error| error.to_string())?,
        names: space.names().into_iter().map(str::to_owned).collect(),
        preset: estimator.preset,
        features: estimator.recipe.clone(),
        architecture: estimator.architecture.id().into(),
        settings: estimator.settings.clone(),
        inputs: readout.network.inputs(),
        outputs: readout.network.outputs(),
        limit: Some(readout.inputs.limit).filter(|limit| limit.is_finite()),
        seed: estimator.seed,
        sha256: String::new(),
    };
    header.sha256 = header.checksum(&tensors)?;
    let text = serde_json::to_string(&header).map_err(|error| error.to_string())?;
    let metadata = Some(HashMap::from([(KEY.to_owned(), text)]));
    safetensors::serialize(tensors, &metadata).map_err(|error| format!("{error:?}"))
}

/// The estimator in the bytes of a file.
fn restored(bytes: &[u8], path: &Path, known: &[Project]) -> Result<Estimator, String> {
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(unread)?;
    let text = (metadata.metadata().as_ref().and_then(|m| m.get(KEY))).ok_or_else(foreign)?;
    let header = Header::parse(text)?;
    let container = SafeTensors::deserialize(bytes).map_err(unread)?;
    let tensors: Tensors<'_> = container.tensors().into_iter().collect();
    if header.checksum(&tensors).as_ref() != Ok(&header.sha256) {
        return Err("the checksum does not match, the file was altered; pretrain again".into());
    }
    let project = project(&header, path, known)?;
    let architecture = architecture(&header, &project)?;
    let (n, d) = (header.inputs, header.outputs);
    let weights: Vec<NamedTensor> = (tensors.iter())
        .filter_map(|(name, tensor)| {
            Some(NamedTensor {
                name: name.strip_prefix(NETWORK)?.to_owned(),
                shape: tensor.shape().to_vec(),
                values: values_of(tensor.data()),
            })
        })
        .collect();
    let network =
        (architecture.restore(n, d, &weights)).map_err(|error| not_whole(&error.to_string()))?;
    let map = header.features.bind(project.study().twin());
    let width = map.map_err(|error| error.to_string())?.dim();
    if width != n {
        let reason = format!("{}, the network reads {n}", count(width, "feature"));
        return Err(not_whole(&reason));
    }
    let row = |name: &str, width: usize| {
        let matrix = matrix(&tensors, name, Some([1, width]))?;
        Ok::<Vec<f64>, String>(matrix.into_iter().collect())
    };
    let truth = matrix(&tensors, "calibration.truth", None)?;
    let same = Some([truth.nrows(), d]);
    Ok(Estimator {
        readout: Readout {
            inputs: Standardiser {
                mean: row("features.mean", n)?,
                matrix: matrix(&tensors, "features.matrix", Some([n, n]))?,
                limit: header.limit.unwrap_or(f64::INFINITY),
            },
            targets: Scaler {
                mean: row("targets.mean", d)?,
                scale: row("targets.scale", d)?,
            },
            layer: None,
            network,
        },
        calibration: Calibration {
            predicted: matrix(&tensors, "calibration.predicted", same)?,
            truth: matrix(&tensors, "calibration.truth", same)?,
        },
        preset: header.preset,
        settings: header.settings,
        recipe: header.features,
        seed: header.seed,
        architecture,
        project,
    })
}

/// The matrix of a tensor of finite 64-bit numbers, of this shape where one is expected.
fn matrix(
    tensors: &Tensors<'_>,
    name: &str,
    expected: Option<[usize; 2]>,
) -> Result<Array2<f64>, String> {
    let read = |tensor: &TensorView<'_>| {
        let (&[rows, columns], Dtype::F64) = (tensor.shape(), tensor.dtype()) else {
            return None;
        };
        let (numbers, _) = tensor.data().as_chunks::<8>();
        let values = numbers.iter().map(|b| f64::from_le_bytes(*b)).collect();
        let matrix = Array2::from_shape_vec((rows, columns), values).ok()?;
        let fits = expected.is_none_or(|expected| expected == [rows, columns]);
        (fits && matrix.iter().all(|v| v.is_finite())).then_some(matrix)
    };
    (tensors.get(name).and_then(read))
        .ok_or_else(|| not_whole(&format!("tensor {name} is missing or misshapen")))
}

/// The problem of a file that is something else, or cut off.
fn not_whole(reason: &str) -> String {
    format!("not a whole estimator file ({reason}); pretrain one again")
}

/// The problem of a file of another kind.
fn foreign() -> String {
    "not an estimator file; give one that was pretrained".into()
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
        E::InvalidHeaderLength | E::MetadataIncompleteBuffer => {
            not_whole("it is cut off, or goes on behind its end")
        }
        _ => not_whole("its tensors are damaged"),
    }
}

/// The known project of the file's twin, in the file's setting.
fn project(header: &Header, path: &Path, known: &[Project]) -> Result<Project, String> {
    let file = StudyFile::parse(&header.study, path).map_err(|error| error.to_string())?;
    let project = match file.own_equations() {
        Some(_) => Study::of_file(&file).map(Project::from),
        None => {
            let registered = known.iter().find(|p| p.study().name() == file.twin);
            let registered = registered.ok_or_else(|| {
                let known: Vec<_> = known.iter().map(|p| p.study().name()).collect();
                format!(
                    "made for twin \"{}\", known are {}; use the program that has this twin",
                    file.twin,
                    known.join(", ")
                )
            })?;
            registered.configure(&file)
        }
    };
    let project = project.map_err(|error| error.to_string())?;
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
    match outputs == names {
        true => Ok(architecture),
        false => Err(not_whole(&format!(
            "{} for {}",
            count(outputs, "output"),
            count(names, "parameter")
        ))),
    }
}
