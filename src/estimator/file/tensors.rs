//! Tensors of an estimator file: weights, scalers and calibration by name.

use crate::estimator::estimator::Estimator;
use crate::estimator::readout::{Calibration, Scaler, Standardiser};
use crate::network::{NamedTensor, bytes_of, values_of};
use ndarray::Array2;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use std::collections::BTreeMap;

/// Prefix of the network's tensors.
const NETWORK: &str = "network/";

/// A tensor as it lies in the file.
struct RawTensor {
    dtype: Dtype,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

impl RawTensor {
    /// A tensor of 64-bit numbers in rows.
    fn of_rows(rows: usize, values: impl IntoIterator<Item = f64>) -> Self {
        let bytes: Vec<u8> = values.into_iter().flat_map(f64::to_le_bytes).collect();
        Self {
            dtype: Dtype::F64,
            shape: vec![rows, bytes.len() / 8 / rows.max(1)],
            bytes,
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

/// All tensors of a file, by name.
pub(super) struct Tensors(BTreeMap<String, RawTensor>);

impl Tensors {
    /// The tensors of an estimator.
    pub fn of(estimator: &Estimator) -> Self {
        let readout = &estimator.readout;
        let mut all: BTreeMap<String, RawTensor> = (readout.network.weights().into_iter())
            .map(|tensor| {
                let raw = RawTensor {
                    dtype: Dtype::F32,
                    shape: tensor.shape,
                    bytes: bytes_of(&tensor.values),
                };
                (format!("{NETWORK}{}", tensor.name), raw)
            })
            .collect();
        let mut put = |name: &str, tensor| all.insert(name.to_owned(), tensor);
        for (name, row) in [
            ("features.mean", &readout.inputs.mean),
            ("targets.mean", &readout.targets.mean),
            ("targets.scale", &readout.targets.scale),
        ] {
            put(name, RawTensor::of_rows(1, row.iter().copied()));
        }
        for (name, matrix) in [
            ("features.matrix", &readout.inputs.matrix),
            ("calibration.predicted", &estimator.calibration.predicted),
            ("calibration.truth", &estimator.calibration.truth),
        ] {
            let values = matrix.iter().copied();
            put(name, RawTensor::of_rows(matrix.nrows(), values));
        }
        Self(all)
    }

    /// The tensors of a container.
    pub fn read(container: &SafeTensors<'_>) -> Self {
        let raw = |view: &TensorView<'_>| RawTensor {
            dtype: view.dtype(),
            shape: view.shape().to_vec(),
            bytes: view.data().to_vec(),
        };
        let tensors = container.tensors().into_iter();
        Self(tensors.map(|(name, view)| (name, raw(&view))).collect())
    }

    /// Views for a container.
    pub fn views(&self) -> Result<Vec<(&String, TensorView<'_>)>, String> {
        (self.0.iter())
            .map(|(name, t)| {
                let view = TensorView::new(t.dtype, t.shape.clone(), &t.bytes);
                Ok((name, view.map_err(|error| format!("{error:?}"))?))
            })
            .collect()
    }

    /// Feeds every tensor to a hash, in the order of names.
    pub fn hash(&self, mut update: impl FnMut(&[u8])) {
        for (name, tensor) in &self.0 {
            let shape = format!("\n{name} {:?} {:?}\n", tensor.dtype, tensor.shape);
            update(shape.as_bytes());
            update(&tensor.bytes);
        }
    }

    /// The network's weights.
    pub fn weights(&self) -> Vec<NamedTensor> {
        (self.0.iter())
            .filter_map(|(name, tensor)| {
                Some(NamedTensor {
                    name: name.strip_prefix(NETWORK)?.to_owned(),
                    shape: tensor.shape.clone(),
                    values: values_of(&tensor.bytes),
                })
            })
            .collect()
    }

    /// The network's inputs: `n` features.
    pub fn inputs(&self, n: usize, limit: f64) -> Result<Standardiser, String> {
        let matrix = self.matrix("features.matrix")?;
        if matrix.dim() != (n, n) {
            return Err(format!("tensor features.matrix is {:?}", matrix.dim()));
        }
        Ok(Standardiser {
            mean: self.row("features.mean", n)?,
            matrix,
            limit,
        })
    }

    /// The network's targets: `d` parameters.
    pub fn targets(&self, d: usize) -> Result<Scaler, String> {
        Ok(Scaler {
            mean: self.row("targets.mean", d)?,
            scale: self.row("targets.scale", d)?,
        })
    }

    /// Predictions of `d` parameters beside the truth.
    pub fn calibration(&self, d: usize) -> Result<Calibration, String> {
        let calibration = Calibration {
            predicted: self.matrix("calibration.predicted")?,
            truth: self.matrix("calibration.truth")?,
        };
        let dim = calibration.truth.dim();
        if calibration.predicted.dim() != dim || dim.1 != d {
            return Err("calibration tensors do not fit each other".into());
        }
        Ok(calibration)
    }

    fn matrix(&self, name: &str) -> Result<Array2<f64>, String> {
        (self.0.get(name).and_then(RawTensor::matrix))
            .ok_or_else(|| format!("tensor {name} is missing or misshapen"))
    }

    fn row(&self, name: &str, width: usize) -> Result<Vec<f64>, String> {
        let values = self.matrix(name)?;
        match values.dim() {
            (1, n) if n == width => Ok(values.into_iter().collect()),
            shape => Err(format!("tensor {name} is {shape:?}")),
        }
    }
}
