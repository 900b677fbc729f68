//! Tensors by name: how weights leave a network and come back, and what is set before training.

use super::NetworkError;
use dfdx::nn::tensor_collection::{
    RecursiveWalker, ScalarOptions, TensorCollection, TensorOptions, TensorVisitor, ViewTensorMut,
    ViewTensorName,
};
use dfdx::prelude::{Cpu, HasShape, Shape, Tensor};
use num_traits::NumCast;
use std::collections::BTreeMap;

/// One tensor of a network.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedTensor {
    /// Its place, such as `trunk.0.weight` or `heads.2.1.gamma`.
    pub name: String,
    /// Size of each dimension; a weight is outputs × inputs.
    pub shape: Vec<usize>,
    /// The numbers, row-major.
    pub values: Vec<f32>,
}

/// Numbers as files hold them: 32 bits each, the lowest byte first.
pub(crate) fn bytes_of(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// The numbers of [`bytes_of`].
pub(crate) fn values_of(bytes: &[u8]) -> Vec<f32> {
    (bytes.as_chunks::<4>().0.iter())
        .map(|b| f32::from_le_bytes(*b))
        .collect()
}

/// Sees a tensor's name and shape, and changes its values.
type Change<'c> = dyn FnMut(&str, &[usize], &mut Vec<f32>) -> Result<(), NetworkError> + 'c;

/// Gives each tensor of a module, by name and shape, to `change`, and takes the values that it leaves.
struct Walk<'c> {
    change: &'c mut Change<'c>,
    /// Probability of every dropout: set in each stored number that is named `p`, as dfdx and we do.
    dropout: Option<f64>,
}

impl TensorVisitor<f32, Cpu> for Walk<'_> {
    type Viewer = (ViewTensorMut, ViewTensorName);
    type Err = NetworkError;
    type E2 = f32;
    type D2 = Cpu;

    fn visit<S: Shape>(
        &mut self,
        _: TensorOptions<S, f32, Cpu>,
        (tensor, name): (&mut Tensor<S, f32, Cpu>, String),
    ) -> Result<Option<Tensor<S, f32, Cpu>>, NetworkError> {
        let mut values = tensor.as_vec();
        let shape: Vec<usize> = tensor.shape().concrete().into();
        (self.change)(&name, &shape, &mut values)?;
        tensor.copy_from(&values);
        Ok(None)
    }

    fn visit_scalar<N: NumCast>(
        &mut self,
        _: ScalarOptions<N>,
        (number, name): (&mut N, String),
    ) -> Result<Option<N>, NetworkError> {
        let dropout = self
            .dropout
            .filter(|_| name.rsplit('.').next() == Some("p"));
        if let Some(p) = dropout.and_then(N::from) {
            *number = p;
        }
        Ok(None)
    }
}

/// Changes each tensor of `module`, their names beginning with `prefix`, and the dropout where one is given.
fn change_each<M: TensorCollection<f32, Cpu>>(
    module: &mut M,
    prefix: &str,
    dropout: Option<f64>,
    change: &mut Change<'_>,
) -> Result<(), NetworkError> {
    M::iter_tensors(&mut RecursiveWalker {
        m: (module, prefix.to_owned()),
        f: &mut Walk { change, dropout },
    })?;
    Ok(())
}

/// Appends the tensors of `module`, their names beginning with `prefix`.
pub(super) fn collect<M: TensorCollection<f32, Cpu> + Clone>(
    module: &M,
    prefix: &str,
    tensors: &mut Vec<NamedTensor>,
) {
    change_each(
        &mut module.clone(),
        prefix,
        None,
        &mut |name, shape, values| {
            tensors.push(NamedTensor {
                name: name.to_owned(),
                shape: shape.to_vec(),
                values: values.clone(),
            });
            Ok(())
        },
    )
    .expect("collecting refuses nothing");
}

/// The error of a stored tensor.
pub(super) fn misfit(name: &str, problem: &str) -> NetworkError {
    NetworkError::Data(format!("tensor `{name}` {problem}"))
}

/// Gives each tensor of `module` the values stored under its name, taking them out of `stored`.
pub(super) fn assign<'s, M: TensorCollection<f32, Cpu>>(
    module: &mut M,
    prefix: &str,
    architecture: &'static str,
    stored: &mut BTreeMap<&'s str, &'s NamedTensor>,
) -> Result<(), NetworkError> {
    change_each(module, prefix, None, &mut |name, expected, values| {
        let refuse = |problem: String| Err(misfit(name, &problem));
        let Some(found) = stored.remove(name) else {
            return refuse(format!(
                "of shape {expected:?} is missing; was it stored by `{architecture}`?"
            ));
        };
        let (shape, count) = (&found.shape, found.values.len());
        if *shape != expected || count != values.len() {
            return refuse(format!(
                "has shape {shape:?} with {count} values, expected {expected:?}"
            ));
        }
        if !found.values.iter().all(|v| v.is_finite()) {
            return refuse("holds a value that is not finite; the file is damaged".into());
        }
        values.copy_from_slice(&found.values);
        Ok(())
    })
}

/// Sets the probability of every dropout in `module`.
pub(super) fn set_dropout<M: TensorCollection<f32, Cpu>>(
    module: &mut M,
    probability: f64,
) -> Result<(), NetworkError> {
    change_each(module, "", Some(probability), &mut |_, _, _| Ok(()))
}

/// Scales the first layer of `module`, whose weight takes `padded` inputs, as if it had been initialised for `inputs`.
///
/// Weights start in ±1/√(fan in). The padding carries nothing into a layer: its weights are zero, and stay so. Were they left to decay,
/// they and their moments would be subnormal numbers after some epochs, and cost most of the training's time.
pub(super) fn widen_first_layer<M: TensorCollection<f32, Cpu>>(
    module: &mut M,
    inputs: usize,
    padded: usize,
) -> Result<(), NetworkError> {
    let factor = (padded as f32 / inputs as f32).sqrt();
    let mut first_layer = None;
    change_each(module, "", None, &mut |name, shape, values| {
        let (layer, field) = name.rsplit_once('.').unwrap_or(("", name));
        if first_layer.is_none() && field == "weight" && shape.last() == Some(&padded) {
            first_layer = Some(layer.to_owned());
            for row in values.chunks_exact_mut(padded) {
                let (own, padding) = row.split_at_mut(inputs);
                own.iter_mut().for_each(|v| *v *= factor);
                padding.fill(0.0);
            }
        } else if first_layer.as_deref() == Some(layer) && field == "bias" {
            values.iter_mut().for_each(|v| *v *= factor);
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::NormDense;
    use dfdx::nn::DeviceBuildExt;
    use dfdx::prelude::{Dropout, Linear, ReLU};

    type Mixed = ((Linear<9, 4>, Dropout), NormDense<4, 4, ReLU>, Linear<4, 1>);

    #[test]
    fn dropout_is_set_in_plain_and_fused_layers() {
        let mut module = Cpu::default().build_module::<Mixed, f32>();
        set_dropout(&mut module, 0.25).unwrap();
        assert_eq!((module.0.1.p, module.1.p), (0.25, 0.25));
    }

    #[test]
    fn only_the_first_layer_is_widened_and_its_padding_is_zero() {
        let before = Cpu::default().build_module::<Mixed, f32>();
        let mut after = before.clone();
        widen_first_layer(&mut after, 1, 9).unwrap();
        let expected = |(i, w): (usize, &f32)| if i % 9 == 0 { 3.0 * w } else { 0.0 };
        let weight = before.0.0.weight.as_vec();
        let expected: Vec<f32> = weight.iter().enumerate().map(expected).collect();
        assert_eq!(after.0.0.weight.as_vec(), expected);
        let bias: Vec<f32> = before.0.0.bias.as_vec().iter().map(|b| 3.0 * b).collect();
        assert_eq!(after.0.0.bias.as_vec(), bias);
        assert_eq!(after.1.weight.as_vec(), before.1.weight.as_vec());
        assert_eq!(after.1.bias.as_vec(), before.1.bias.as_vec());
    }
}
