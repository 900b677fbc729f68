//! Fused layers: a linear map, optionally layer normalisation, activation and dropout as one taped dfdx operation.
//!
//! A plain tuple `(Linear<I, O>, LayerNorm1D<O>, Tanh, Dropout)` records a score of operations, each with passes of its
//! own over memory; [`NormDense<I, O, Tanh>`](NormDense) computes the same as one operation. A whole training step
//! becomes more than four times faster (`benches/network.rs`). Fused and plain layers mix freely in one tuple.

use super::activation::Activation;
use super::gemm::{Existing, Matrix, multiply};
use super::kernel::{self, Affine, Mask};
use crate::network::{Batch, TapedBatch};
use dfdx::nn::modules::{BuildOnDevice, ModuleVisitor, TensorCollection};
use dfdx::nn::{Module, ModuleMut, ScalarOptions, TensorOptions};
use dfdx::prelude::*;
use dfdx::tensor::TensorFromVec;
use num_traits::Float;
use rand_distr::uniform::SampleUniform;
use std::marker::PhantomData;

/// Linear map, activation (tanh unless named) and dropout in one: `Dense<I, O, A>` is `(Linear<I, O>, A, Dropout)`.
///
/// out = dropout(A(xWᵀ + b)), x: rows × I, out: rows × O. W and b start uniform in ±1/√I.
#[derive(Debug)]
pub struct Dense<const I: usize, const O: usize, A = Tanh>(PhantomData<A>);

/// Linear map, layer normalisation, activation and dropout in one: `NormDense<I, O, A>` is `(Linear<I, O>, LayerNorm1D<O>, A, Dropout)`.
///
/// out = dropout(A(γ·(z − mean z)/√(var z + 1e-5) + β)), z = xWᵀ + b, x: rows × I, out: rows × O. W and b start uniform
/// in ±1/√I, γ at 1, β at 0.
#[derive(Debug)]
pub struct NormDense<const I: usize, const O: usize, A>(PhantomData<A>);

/// [`Dense`] on a device: the layer with its tensors.
#[derive(Debug, Clone)]
pub struct BuiltDense<const I: usize, const O: usize, A, E: Dtype, D: Device<E>> {
    /// W, O × I.
    pub weight: Tensor<Rank2<O, I>, E, D>,
    /// b.
    pub bias: Tensor<Rank1<O>, E, D>,
    /// Probability that an output is dropped in training.
    pub p: f32,
    activation: PhantomData<A>,
}

/// [`NormDense`] on a device: the layer with its tensors.
#[derive(Debug, Clone)]
pub struct BuiltNormDense<const I: usize, const O: usize, A, E: Dtype, D: Device<E>> {
    /// W, O × I.
    pub weight: Tensor<Rank2<O, I>, E, D>,
    /// b.
    pub bias: Tensor<Rank1<O>, E, D>,
    /// γ, the scale after normalisation.
    pub gamma: Tensor<Rank1<O>, E, D>,
    /// β, the shift after normalisation.
    pub beta: Tensor<Rank1<O>, E, D>,
    /// Probability that an output is dropped in training.
    pub p: f32,
    activation: PhantomData<A>,
}

/// A layer's tensors, borrowed from either kind: all the arithmetic is here, once.
struct Layer<'a, const I: usize, const O: usize> {
    weight: &'a Tensor<Rank2<O, I>, f32, Cpu>,
    bias: &'a Tensor<Rank1<O>, f32, Cpu>,
    /// γ and β.
    affine: Option<[&'a Tensor<Rank1<O>, f32, Cpu>; 2]>,
    p: f32,
}

impl<const I: usize, const O: usize> Layer<'_, I, O> {
    fn evaluate<A: Activation>(&self, x: Batch<Const<I>>) -> Result<Batch<Const<O>>, CpuError> {
        let x = x.try_contiguous()?;
        let rows = x.shape().0;
        let (z, _) = self.compute::<A>(&numbers(&x), &numbers(self.weight), rows, None);
        x.device().try_tensor_from_vec(z, (rows, Const))
    }

    fn train<A: Activation>(
        &self,
        x: TapedBatch<Const<I>>,
    ) -> Result<TapedBatch<Const<O>>, CpuError> {
        let (x, mut tape) = x.try_contiguous()?.split_tape();
        let rows = x.shape().0;
        let mask = (self.p > 0.0).then(|| Mask {
            probability: self.p,
            seed: x.device().random_u64(),
        });
        let (input, weight) = (numbers(&x), numbers(self.weight));
        let (out, saved) = self.compute::<A>(&input, &weight, rows, mask);
        let out = x.device().try_tensor_from_vec(out, (rows, Const::<O>))?;

        let (out_id, x_id) = (out.ghost(), x.ghost());
        let (weight_id, bias_id) = (self.weight.ghost(), self.bias.ghost());
        let affine_ids = self
            .affine
            .map(|[gamma, beta]| [gamma.ghost(), beta.ghost()]);
        let gamma = self.affine.map(|[gamma, _]| numbers(gamma));
        tape.add_backward_op(move |gradients| {
            // Nobody reads the gradient of `out` after this: take it as the work space.
            let mut d = std::mem::take::<Vec<f32>>(&mut **gradients.get_or_alloc_mut(&out_id)?);
            let sums = kernel::backward(&mut d, O, gamma.as_deref(), &saved);
            kernel::add(gradients.get_or_alloc_mut(&bias_id)?, &sums.bias);
            if let Some([gamma, beta]) = &affine_ids {
                kernel::add(gradients.get_or_alloc_mut(gamma)?, &sums.gamma);
                kernel::add(gradients.get_or_alloc_mut(beta)?, &sums.beta);
            }
            let d = Matrix::new(&d, rows, O, O);
            let (input, weight) = (
                Matrix::new(&input, rows, I, I),
                Matrix::new(&weight, O, I, I),
            );
            let of_weight = gradients.get_or_alloc_mut(&weight_id)?;
            multiply(1.0, d.transposed(), input, Existing::Add, of_weight, I);
            let of_input = gradients.get_or_alloc_mut(&x_id)?;
            multiply(1.0, d, weight, Existing::Add, of_input, I);
            Ok(())
        });
        Ok(out.put_tape(tape))
    }

    fn compute<A: Activation>(
        &self,
        x: &[f32],
        weight: &[f32],
        rows: usize,
        mask: Option<Mask>,
    ) -> (Vec<f32>, kernel::Saved) {
        let mut z = vec![0.0; rows * O];
        let (x, weight) = (Matrix::new(x, rows, I, I), Matrix::new(weight, O, I, I));
        multiply(1.0, x, weight.transposed(), Existing::Replace, &mut z, O);
        let vectors = self.affine.map(|pair| pair.map(numbers));
        let affine = vectors.as_ref().map(|[gamma, beta]| Affine { gamma, beta });
        let saved = kernel::forward::<A>(&mut z, &numbers(self.bias), affine, mask);
        (z, saved)
    }
}

/// The numbers of a contiguous tensor, row-major. A copy, since dfdx lends no slice of a tensor.
pub(in crate::network) fn numbers<S: Shape>(tensor: &Tensor<S, f32, Cpu>) -> Vec<f32> {
    let mut numbers = vec![0.0; tensor.shape().num_elements()];
    tensor.copy_into(&mut numbers);
    numbers
}

fn uniform<S: ConstShape, E: Dtype + Float + SampleUniform, D: Device<E>>(
    tensor: &mut Tensor<S, E, D>,
    fan_in: usize,
) -> Result<(), D::Err> {
    let fan_in = E::from_usize(fan_in).expect("a layer's width is a small number");
    let bound = E::ONE / Float::sqrt(fan_in);
    tensor.try_fill_with_distr(rand_distr::Uniform::new(-bound, bound))
}

impl<const I: usize, const O: usize, A: Activation> BuildOnDevice<Cpu, f32> for Dense<I, O, A> {
    type Built = BuiltDense<I, O, A, f32, Cpu>;
}

impl<const I: usize, const O: usize, A: Activation> BuildOnDevice<Cpu, f32> for NormDense<I, O, A> {
    type Built = BuiltNormDense<I, O, A, f32, Cpu>;
}

impl<const I: usize, const O: usize, A, E, D> TensorCollection<E, D> for BuiltDense<I, O, A, E, D>
where
    E: Dtype + Float + SampleUniform,
    D: Device<E>,
{
    type To<E2: Dtype, D2: Device<E2>> = BuiltDense<I, O, A, E2, D2>;

    fn iter_tensors<V: ModuleVisitor<Self, E, D>>(
        visitor: &mut V,
    ) -> Result<Option<Self::To<V::E2, V::D2>>, V::Err> {
        let weight = TensorOptions::reset_with(|t| uniform(t, I));
        let bias = TensorOptions::reset_with(|t| uniform(t, I));
        visitor.visit_fields(
            (
                Self::tensor("weight", |s| &s.weight, |s| &mut s.weight, weight),
                Self::tensor("bias", |s| &s.bias, |s| &mut s.bias, bias),
                Self::scalar(
                    "p",
                    |s| &s.p,
                    |s| &mut s.p,
                    ScalarOptions::from_default(0.0),
                ),
            ),
            |(weight, bias, p)| BuiltDense {
                weight,
                bias,
                p,
                activation: PhantomData,
            },
        )
    }
}

impl<const I: usize, const O: usize, A, E, D> TensorCollection<E, D>
    for BuiltNormDense<I, O, A, E, D>
where
    E: Dtype + Float + SampleUniform,
    D: Device<E>,
{
    type To<E2: Dtype, D2: Device<E2>> = BuiltNormDense<I, O, A, E2, D2>;

    fn iter_tensors<V: ModuleVisitor<Self, E, D>>(
        visitor: &mut V,
    ) -> Result<Option<Self::To<V::E2, V::D2>>, V::Err> {
        let weight = TensorOptions::reset_with(|t| uniform(t, I));
        let bias = TensorOptions::reset_with(|t| uniform(t, I));
        let (gamma, beta) = (
            TensorOptions::reset_to_ones(),
            TensorOptions::reset_to_zeros(),
        );
        visitor.visit_fields(
            (
                Self::tensor("weight", |s| &s.weight, |s| &mut s.weight, weight),
                Self::tensor("bias", |s| &s.bias, |s| &mut s.bias, bias),
                Self::tensor("gamma", |s| &s.gamma, |s| &mut s.gamma, gamma),
                Self::tensor("beta", |s| &s.beta, |s| &mut s.beta, beta),
                Self::scalar(
                    "p",
                    |s| &s.p,
                    |s| &mut s.p,
                    ScalarOptions::from_default(0.0),
                ),
            ),
            |(weight, bias, gamma, beta, p)| BuiltNormDense {
                weight,
                bias,
                gamma,
                beta,
                p,
                activation: PhantomData,
            },
        )
    }
}

impl<const I: usize, const O: usize, A> BuiltDense<I, O, A, f32, Cpu> {
    fn layer(&self) -> Layer<'_, I, O> {
        Layer {
            weight: &self.weight,
            bias: &self.bias,
            affine: None,
            p: self.p,
        }
    }
}

impl<const I: usize, const O: usize, A> BuiltNormDense<I, O, A, f32, Cpu> {
    fn layer(&self) -> Layer<'_, I, O> {
        Layer {
            weight: &self.weight,
            bias: &self.bias,
            affine: Some([&self.gamma, &self.beta]),
            p: self.p,
        }
    }
}

macro_rules! forward_through_layer {
    ($built:ident) => {
        impl<const I: usize, const O: usize, A: Activation> Module<Batch<Const<I>>>
            for $built<I, O, A, f32, Cpu>
        {
            type Output = Batch<Const<O>>;
            type Error = CpuError;

            fn try_forward(&self, x: Batch<Const<I>>) -> Result<Self::Output, CpuError> {
                self.layer().evaluate::<A>(x)
            }
        }

        impl<const I: usize, const O: usize, A: Activation> ModuleMut<TapedBatch<Const<I>>>
            for $built<I, O, A, f32, Cpu>
        {
            type Output = TapedBatch<Const<O>>;
            type Error = CpuError;

            fn try_forward_mut(
                &mut self,
                x: TapedBatch<Const<I>>,
            ) -> Result<Self::Output, CpuError> {
                self.layer().train::<A>(x)
            }
        }
    };
}
forward_through_layer!(BuiltDense);
forward_through_layer!(BuiltNormDense);

#[cfg(test)]
mod tests;
