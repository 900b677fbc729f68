//! Tensors by name: how weights leave a network and come back, and what is set before training.

use super::NetworkError;
use dfdx::nn::tensor_collection::{
    RecursiveWalker, ScalarOptions, TensorCollection, TensorOptions, TensorVisitor, ViewTensorMut,
    ViewTensorName, ViewTensorRef,
};
use dfdx::prelude::{Cpu, HasShape, Shape, Tensor};
use num_traits::NumCast;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One tensor of a network.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
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
    (bytes.chunks_exact(4))
        .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
        .collect()
}

/// Return type of a visitor of tensors, which builds nothing.
type Visited<S> = Result<Option<Tensor<S, f32, Cpu>>, NetworkError>;

fn sizes<S: Shape>(tensor: &Tensor<S, f32, Cpu>) -> Vec<usize> {
    tensor.shape().concrete().into()
}

/// Appends the tensors of `module`, their names beginning with `prefix`.
pub(super) fn collect<M: TensorCollection<f32, Cpu>>(
    module: &M,
    prefix: &str,
    tensors: &mut Vec<NamedTensor>,
) {
    struct Collect<'a>(&'a mut Vec<NamedTensor>);
    impl TensorVisitor<f32, Cpu> for Collect<'_> {
        type Viewer = (ViewTensorRef, ViewTensorName);
        type Err = NetworkError;
        type E2 = f32;
        type D2 = Cpu;

        fn visit<S: Shape>(
            &mut self,
            _: TensorOptions<S, f32, Cpu>,
            (tensor, name): (&Tensor<S, f32, Cpu>, String),
        ) -> Visited<S> {
            self.0.push(NamedTensor {
                name,
                shape: sizes(tensor),
                values: tensor.as_vec(),
            });
            Ok(None)
        }
    }
    M::iter_tensors(&mut RecursiveWalker {
        m: (module, prefix.to_owned()),
        f: &mut Collect(tensors),
    })
    .expect("collecting refuses nothing");
}

/// Gives each tensor of `module`, by name and shape, to `change`, and takes the values that it leaves.
fn change_each<M: TensorCollection<f32, Cpu>>(
    module: &mut M,
    prefix: &str,
    change: impl FnMut(&str, &[usize], &mut [f32]) -> Result<(), NetworkError>,
) -> Result<(), NetworkError> {
    struct Change<F>(F);
    impl<F> TensorVisitor<f32, Cpu> for Change<F>
    where
        F: FnMut(&str, &[usize], &mut [f32]) -> Result<(), NetworkError>,
    {
        type Viewer = (ViewTensorMut, ViewTensorName);
        type Err = NetworkError;
        type E2 = f32;
        type D2 = Cpu;

        fn visit<S: Shape>(
            &mut self,
            _: TensorOptions<S, f32, Cpu>,
            (tensor, name): (&mut Tensor<S, f32, Cpu>, String),
        ) -> Visited<S> {
            let mut values = tensor.as_vec();
            (self.0)(&name, &sizes(tensor), &mut values)?;
            tensor.copy_from(&values);
            Ok(None)
        }
    }
    M::iter_tensors(&mut RecursiveWalker {
        m: (module, prefix.to_owned()),
        f: &mut Change(change),
    })?;
    Ok(())
}

/// Gives each tensor of `module` the values stored under its name, taking them out of `stored`.
pub(super) fn assign<'s, M: TensorCollection<f32, Cpu>>(
    module: &mut M,
    prefix: &str,
    architecture: &'static str,
    stored: &mut BTreeMap<&'s str, &'s NamedTensor>,
) -> Result<(), NetworkError> {
    change_each(module, prefix, |name, shape, values| {
        let (name, expected) = (name.to_owned(), shape.to_vec());
        let Some(found) = stored.remove(name.as_str()) else {
            return Err(NetworkError::MissingTensor {
                name,
                expected,
                architecture,
            });
        };
        if found.shape != expected || found.values.len() != values.len() {
            return Err(NetworkError::MisshapenTensor {
                name,
                expected,
                found: found.shape.clone(),
                values: found.values.len(),
            });
        }
        if !found.values.iter().all(|v| v.is_finite()) {
            return Err(NetworkError::DamagedTensor { name });
        }
        values.copy_from_slice(&found.values);
        Ok(())
    })
}

/// Sets the probability of every dropout in `module`: each stored number that is named `p`, as dfdx and we do.
pub(super) fn set_dropout<M: TensorCollection<f32, Cpu>>(module: &mut M, probability: f64) {
    struct SetDropout(f64);
    impl TensorVisitor<f32, Cpu> for SetDropout {
        type Viewer = (ViewTensorMut, ViewTensorName);
        type Err = NetworkError;
        type E2 = f32;
        type D2 = Cpu;

        fn visit<S: Shape>(
            &mut self,
            _: TensorOptions<S, f32, Cpu>,
            _: (&mut Tensor<S, f32, Cpu>, String),
        ) -> Visited<S> {
            Ok(None)
        }

        fn visit_scalar<N: NumCast>(
            &mut self,
            _: ScalarOptions<N>,
            (number, name): (&mut N, String),
        ) -> Result<Option<N>, NetworkError> {
            if let (Some("p"), Some(p)) = (name.rsplit('.').next(), N::from(self.0)) {
                *number = p;
            }
            Ok(None)
        }
    }
    M::iter_tensors(&mut RecursiveWalker {
        m: (module, String::new()),
        f: &mut SetDropout(probability),
    })
    .expect("setting dropout refuses nothing");
}

/// Scales the first layer of `module`, whose weight takes `padded` inputs, as if it had been initialised for `inputs`.
///
/// Weights start in ±1/√(fan in), and the padding carries nothing into a layer.
pub(super) fn widen_first_layer<M: TensorCollection<f32, Cpu>>(
    module: &mut M,
    inputs: usize,
    padded: usize,
) {
    let factor = (padded as f32 / inputs as f32).sqrt();
    let mut first_layer = None;
    change_each(module, "", |name, shape, values| {
        let (layer, field) = name.rsplit_once('.').unwrap_or(("", name));
        let is_first = match &first_layer {
            None => field == "weight" && shape.last() == Some(&padded),
            Some(first) => first == layer && field == "bias",
        };
        if is_first {
            first_layer = Some(layer.to_owned());
            values.iter_mut().for_each(|v| *v *= factor);
        }
        Ok(())
    })
    .expect("scaling refuses nothing");
}

#[cfg(test)]
mod tests {
    use super::*;
    use dfdx::nn::DeviceBuildExt;
    use dfdx::prelude::{Dropout, Linear, ReLU};

    use crate::network::NormDense;

    type Mixed = ((Linear<9, 4>, Dropout), NormDense<4, 4, ReLU>, Linear<4, 1>);

    #[test]
    fn dropout_is_set_in_plain_and_fused_layers() {
        let mut module = Cpu::default().build_module::<Mixed, f32>();
        set_dropout(&mut module, 0.25);
        assert_eq!((module.0.1.p, module.1.p), (0.25, 0.25));
    }

    #[test]
    fn only_the_first_layer_is_widened() {
        let before = Cpu::default().build_module::<Mixed, f32>();
        let mut after = before.clone();
        widen_first_layer(&mut after, 1, 9);
        let scaled = |x: Vec<f32>| x.into_iter().map(|v| v * 3.0).collect::<Vec<_>>();
        assert_eq!(
            after.0.0.weight.as_vec(),
            scaled(before.0.0.weight.as_vec())
        );
        assert_eq!(after.0.0.bias.as_vec(), scaled(before.0.0.bias.as_vec()));
        assert_eq!(after.1.weight.as_vec(), before.1.weight.as_vec());
        assert_eq!(after.1.bias.as_vec(), before.1.bias.as_vec());
    }
}
