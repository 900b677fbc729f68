//! Fused layers: a linear map, optionally layer normalisation, activation and dropout as one taped dfdx operation.
//!
//! A plain tuple `(Linear<I, O>, LayerNorm1D<O>, Tanh, Dropout)` records a score of operations, each with passes of its
//! own over memory; [`NormDense<I, O, Tanh>`](NormDense) computes the same as one operation. A whole training step
//! becomes more than four times faster (`benches/speed/network.rs`). Fused and plain layers mix freely in one tuple.
//!
//! ```text
//! z = xWᵀ + bias
//! z ← γ·x̂ + β,  x̂ = (z − mean z)/√(var z + ε)     where the layer is normalised
//! out = activation(z)·mask/(1 − p)                mask: 0 with probability p, else 1
//! ```
//!
//! Loops are compiled for the widest vectors of the processor. Sums run in sixteen lanes whatever that width is, so
//! that it does not change their bits.

use super::{PlainBatch, TapedBatch};
use crate::math::widest;
use dfdx::nn::modules::{BuildOnDevice, ModuleVisitor, TensorCollection};
use dfdx::nn::{Module, ModuleMut, ScalarOptions, TensorOptions};
use dfdx::prelude::*;
use dfdx::tensor::TensorFromVec;
use ndarray::linalg::general_mat_mul;
use ndarray::{ArrayView2, ArrayViewMut2};
use num_traits::Float;
use rand_distr::uniform::SampleUniform;
use std::fmt::Debug;
use std::marker::PhantomData;

/// Added to the variance, as in dfdx and PyTorch.
const EPSILON: f32 = 1e-5;
const LANES: usize = 16;
/// Slope of [`Leaky`] below zero.
const LEAK: f32 = 0.01;

/// The element-wise function of [`Dense`] and [`NormDense`], named as a type.
///
/// dfdx's own [`ReLU`] and [`Tanh`] are activations, and so is [`Leaky`]; each of the three also stands as a layer of
/// its own in a plain dfdx tuple.
pub trait Activation: Debug + Default + Clone + Send + Sync + 'static {
    /// a = f(z).
    fn value(z: f32) -> f32;

    /// f′(z), written as a function of `value` = f(z).
    fn slope(value: f32) -> f32;
}

/// max(z, 0.01·z): PyTorch's leaky ReLU. (dfdx's `LeakyReLU` has the slope 0.05.)
#[derive(Debug, Default, Clone, Copy)]
pub struct Leaky;

impl Activation for Leaky {
    #[inline(always)]
    fn value(z: f32) -> f32 {
        if z < 0.0 { LEAK * z } else { z }
    }

    #[inline(always)]
    fn slope(value: f32) -> f32 {
        if value < 0.0 { LEAK } else { 1.0 }
    }
}

impl dfdx::nn::ZeroSizedModule for Leaky {}
impl dfdx::nn::NonMutableModule for Leaky {}

impl<S: Shape, E: Dtype, D: Device<E>, T: Tape<E, D>> Module<Tensor<S, E, D, T>> for Leaky {
    type Output = Tensor<S, E, D, T>;
    type Error = D::Err;

    fn try_forward(&self, input: Tensor<S, E, D, T>) -> Result<Self::Output, D::Err> {
        let leak = E::from_f32(LEAK).expect("each dfdx number type holds 0.01");
        input.try_prelu(leak)
    }
}

impl Activation for ReLU {
    #[inline(always)]
    fn value(z: f32) -> f32 {
        // Not `max`: a NaN must stay one, so that training notices.
        if z < 0.0 { 0.0 } else { z }
    }

    #[inline(always)]
    fn slope(value: f32) -> f32 {
        if value > 0.0 { 1.0 } else { 0.0 }
    }
}

impl Activation for Tanh {
    /// Rational minimax approximation (the coefficients of Eigen's `ptanh`), within 5e-7 of tanh; unlike the library
    /// function it is computed for many elements at once.
    #[inline(always)]
    fn value(z: f32) -> f32 {
        const NUMERATOR: [f32; 7] = [
            -2.760_768_5e-16,
            2.000_188e-13,
            -8.604_672e-11,
            5.122_297e-8,
            1.485_722_4e-5,
            6.372_619_3e-4,
            4.893_524_6e-3,
        ];
        const DENOMINATOR: [f32; 4] =
            [1.198_258_4e-6, 1.185_347_1e-4, 2.268_434_6e-3, 4.893_525e-3];
        let z = z.clamp(-7.905_311, 7.905_311);
        let s = z * z;
        let horner = |p: f32, coefficient: &f32| p * s + coefficient;
        let numerator = NUMERATOR[1..].iter().fold(NUMERATOR[0], horner);
        z * numerator / DENOMINATOR[1..].iter().fold(DENOMINATOR[0], horner)
    }

    #[inline(always)]
    fn slope(value: f32) -> f32 {
        1.0 - value * value
    }
}

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

/// Defines the tensors of a fused layer on a device, and how dfdx walks and calls it.
macro_rules! fused_layer {
    ($layer:ident, $built:ident, [$($vector:ident: $reset:ident),*]) => {
        /// The layer on a device, with its tensors.
        #[derive(Debug, Clone)]
        pub struct $built<const I: usize, const O: usize, A, E: Dtype, D: Device<E>> {
            /// W, O × I.
            pub weight: Tensor<Rank2<O, I>, E, D>,
            /// b.
            pub bias: Tensor<Rank1<O>, E, D>,
            $(
                /// Scale γ or shift β after normalisation.
                pub $vector: Tensor<Rank1<O>, E, D>,
            )*
            /// Probability that an output is dropped in training.
            pub p: f32,
            activation: PhantomData<A>,
        }

        impl<const I: usize, const O: usize, A: Activation> BuildOnDevice<Cpu, f32> for $layer<I, O, A> {
            type Built = $built<I, O, A, f32, Cpu>;
        }

        impl<const I: usize, const O: usize, A, E, D> TensorCollection<E, D> for $built<I, O, A, E, D>
        where
            E: Dtype + Float + SampleUniform,
            D: Device<E>,
        {
            type To<E2: Dtype, D2: Device<E2>> = $built<I, O, A, E2, D2>;

            fn iter_tensors<V: ModuleVisitor<Self, E, D>>(
                visitor: &mut V,
            ) -> Result<Option<Self::To<V::E2, V::D2>>, V::Err> {
                let weight = TensorOptions::reset_with(|t| uniform(t, I));
                let bias = TensorOptions::reset_with(|t| uniform(t, I));
                let p = ScalarOptions::from_default(0.0);
                visitor.visit_fields(
                    (
                        Self::tensor("weight", |s| &s.weight, |s| &mut s.weight, weight),
                        Self::tensor("bias", |s| &s.bias, |s| &mut s.bias, bias),
                        $(Self::tensor(
                            stringify!($vector),
                            |s| &s.$vector,
                            |s| &mut s.$vector,
                            TensorOptions::$reset(),
                        ),)*
                        Self::scalar("p", |s| &s.p, |s| &mut s.p, p),
                    ),
                    |(weight, bias, $($vector,)* p)| $built {
                        weight,
                        bias,
                        $($vector,)*
                        p,
                        activation: PhantomData,
                    },
                )
            }
        }

        impl<const I: usize, const O: usize, A> $built<I, O, A, f32, Cpu> {
            fn layer(&self) -> Layer<'_, I, O> {
                Layer {
                    weight: &self.weight,
                    bias: &self.bias,
                    affine: vec![$(&self.$vector),*].try_into().ok(),
                    p: self.p,
                }
            }
        }

        impl<const I: usize, const O: usize, A: Activation> Module<PlainBatch<Const<I>>>
            for $built<I, O, A, f32, Cpu>
        {
            type Output = PlainBatch<Const<O>>;
            type Error = CpuError;

            fn try_forward(&self, x: PlainBatch<Const<I>>) -> Result<Self::Output, CpuError> {
                self.layer().evaluate::<A>(x)
            }
        }

        impl<const I: usize, const O: usize, A: Activation> ModuleMut<TapedBatch<Const<I>>>
            for $built<I, O, A, f32, Cpu>
        {
            type Output = TapedBatch<Const<O>>;
            type Error = CpuError;

            fn try_forward_mut(&mut self, x: TapedBatch<Const<I>>) -> Result<Self::Output, CpuError> {
                self.layer().train::<A>(x)
            }
        }
    };
}
fused_layer!(Dense, BuiltDense, []);
fused_layer!(NormDense, BuiltNormDense, [gamma: reset_to_ones, beta: reset_to_zeros]);

fn uniform<S: ConstShape, E: Dtype + Float + SampleUniform, D: Device<E>>(
    tensor: &mut Tensor<S, E, D>,
    fan_in: usize,
) -> Result<(), D::Err> {
    let fan_in = E::from_usize(fan_in).expect("a layer's width is a small number");
    let bound = E::ONE / Float::sqrt(fan_in);
    tensor.try_fill_with_distr(rand_distr::Uniform::new(-bound, bound))
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
    fn evaluate<A: Activation>(
        &self,
        x: PlainBatch<Const<I>>,
    ) -> Result<PlainBatch<Const<O>>, CpuError> {
        let x = x.try_contiguous()?;
        let rows = x.shape().0;
        let (z, _) = self.compute::<A>(&numbers(&x), &numbers(self.weight), None);
        x.device().try_tensor_from_vec(z, (rows, Const))
    }

    fn train<A: Activation>(
        &self,
        x: TapedBatch<Const<I>>,
    ) -> Result<TapedBatch<Const<O>>, CpuError> {
        let (x, mut tape) = x.try_contiguous()?.split_tape();
        let rows = x.shape().0;
        let mask = (self.p > 0.0).then(|| DropoutMask {
            probability: self.p,
            seed: x.device().random_u64(),
        });
        let (input, weight) = (numbers(&x), numbers(self.weight));
        let (out, saved) = self.compute::<A>(&input, &weight, mask);
        let out = x.device().try_tensor_from_vec(out, (rows, Const::<O>))?;

        let (out_id, x_id) = (out.ghost(), x.ghost());
        let (weight_id, bias_id) = (self.weight.ghost(), self.bias.ghost());
        let affine_ids = self.affine.map(|pair| pair.map(|vector| vector.ghost()));
        let gamma = self.affine.map(|[gamma, _]| numbers(gamma));
        tape.add_backward_op(move |gradients| {
            // Nobody reads the gradient of `out` after this: take it as the work space.
            let mut d = std::mem::take::<Vec<f32>>(&mut **gradients.get_or_alloc_mut(&out_id)?);
            let sums = backward(&mut d, O, gamma.as_deref(), &saved);
            add(gradients.get_or_alloc_mut(&bias_id)?, &sums.bias);
            if let Some([gamma, beta]) = &affine_ids {
                add(gradients.get_or_alloc_mut(gamma)?, &sums.gamma);
                add(gradients.get_or_alloc_mut(beta)?, &sums.beta);
            }
            let d = view(&d, O);
            let mut of_weight = view_mut(gradients.get_or_alloc_mut(&weight_id)?, I);
            general_mat_mul(1.0, &d.t(), &view(&input, I), 1.0, &mut of_weight);
            let mut of_input = view_mut(gradients.get_or_alloc_mut(&x_id)?, I);
            general_mat_mul(1.0, &d, &view(&weight, I), 1.0, &mut of_input);
            Ok(())
        });
        Ok(out.put_tape(tape))
    }

    fn compute<A: Activation>(
        &self,
        x: &[f32],
        weight: &[f32],
        mask: Option<DropoutMask>,
    ) -> (Vec<f32>, Saved) {
        let mut z = vec![0.0; x.len() / I * O];
        let (x, weight) = (view(x, I), view(weight, I));
        general_mat_mul(1.0, &x, &weight.t(), 0.0, &mut view_mut(&mut z, O));
        let affine = self.affine.map(|pair| pair.map(numbers));
        let affine = affine.as_ref().map(|[gamma, beta]| [&gamma[..], beta]);
        let saved = forward::<A>(&mut z, &numbers(self.bias), affine, mask);
        (z, saved)
    }
}

/// The numbers of a contiguous tensor, row-major. A copy, since dfdx lends no slice of a tensor.
pub(super) fn numbers<S: Shape>(tensor: &Tensor<S, f32, Cpu>) -> Vec<f32> {
    let mut numbers = vec![0.0; tensor.shape().num_elements()];
    tensor.copy_into(&mut numbers);
    numbers
}

/// Row-major numbers as a matrix of rows of `width`.
pub(super) fn view(numbers: &[f32], width: usize) -> ArrayView2<'_, f32> {
    let shape = (numbers.len() / width, width);
    ArrayView2::from_shape(shape, numbers).expect("whole rows")
}

/// As [`view`], to write into.
pub(super) fn view_mut(numbers: &mut [f32], width: usize) -> ArrayViewMut2<'_, f32> {
    let shape = (numbers.len() / width, width);
    ArrayViewMut2::from_shape(shape, numbers).expect("whole rows")
}

/// Results of the forward pass that the backward pass needs.
struct Saved {
    /// x̂, rows × outputs; empty without normalisation.
    normalised: Vec<f32>,
    /// 1/√(var + ε) of each row; empty without normalisation.
    inverse_std: Vec<f32>,
    /// d out/d (input of the activation), rows × outputs.
    slope: Vec<f32>,
}

/// Gradients of a layer's vectors; `gamma` and `beta` are empty without normalisation.
struct VectorGradients {
    bias: Vec<f32>,
    gamma: Vec<f32>,
    beta: Vec<f32>,
}

/// Turns `z` = xWᵀ (rows × outputs) into the layer's output, in place; `affine` holds γ and β.
fn forward<A: Activation>(
    z: &mut [f32],
    bias: &[f32],
    affine: Option<[&[f32]; 2]>,
    mask: Option<DropoutMask>,
) -> Saved {
    let outputs = bias.len();
    let normed = if affine.is_some() { z.len() } else { 0 };
    let mut saved = Saved {
        normalised: vec![0.0; normed],
        inverse_std: vec![0.0; normed / outputs],
        slope: vec![0.0; z.len()],
    };
    widest(|| {
        for (row, z) in z.chunks_exact_mut(outputs).enumerate() {
            let span = row * outputs..(row + 1) * outputs;
            add(z, bias);
            if let Some(affine) = affine {
                let normalised = &mut saved.normalised[span.clone()];
                saved.inverse_std[row] = normalise(z, affine, normalised);
            }
            let slope = &mut saved.slope[span];
            for (z, slope) in z.iter_mut().zip(slope.iter_mut()) {
                *z = A::value(*z);
                *slope = A::slope(*z);
            }
            if let Some(mask) = mask {
                mask.apply(row, z, slope);
            }
        }
    });
    saved
}

/// Turns `d` = d loss/d output (rows × `outputs`) into d loss/d z, in place, and sums the vectors' gradients.
fn backward(
    d: &mut [f32],
    outputs: usize,
    gamma: Option<&[f32]>,
    saved: &Saved,
) -> VectorGradients {
    let normed = gamma.map_or(0, <[f32]>::len);
    let mut sums = VectorGradients {
        bias: vec![0.0; outputs],
        gamma: vec![0.0; normed],
        beta: vec![0.0; normed],
    };
    widest(|| {
        for (row, d) in d.chunks_exact_mut(outputs).enumerate() {
            let span = row * outputs..(row + 1) * outputs;
            for (d, slope) in d.iter_mut().zip(&saved.slope[span.clone()]) {
                *d *= slope;
            }
            if let Some(gamma) = gamma {
                let normalised = &saved.normalised[span];
                for ((sum, d), x) in sums.gamma.iter_mut().zip(&*d).zip(normalised) {
                    *sum += d * x;
                }
                add(&mut sums.beta, d);
                unnormalise(d, gamma, normalised, saved.inverse_std[row]);
            }
            add(&mut sums.bias, d);
        }
    });
    sums
}

/// sums ← sums + x.
#[inline(always)]
pub(super) fn add(sums: &mut [f32], x: &[f32]) {
    for (sum, x) in sums.iter_mut().zip(x) {
        *sum += x;
    }
}

/// z ← γx̂ + β with x̂ left in `normalised`; returns 1/√(var z + ε).
#[inline(always)]
fn normalise(z: &mut [f32], [gamma, beta]: [&[f32]; 2], normalised: &mut [f32]) -> f32 {
    let count = z.len() as f32;
    let mean = sum(z, z, |v, _| v) / count;
    let variance = sum(z, z, |v, _| (v - mean) * (v - mean)) / count;
    let inverse_std = 1.0 / (variance + EPSILON).sqrt();
    let scale_shift = gamma.iter().zip(beta);
    for ((z, x), (gamma, beta)) in z.iter_mut().zip(normalised).zip(scale_shift) {
        *x = (*z - mean) * inverse_std;
        *z = gamma * *x + beta;
    }
    inverse_std
}

/// d loss/d (γx̂ + β) → d loss/d z: with g = γd, (g − mean g − x̂·mean(g·x̂))/std.
#[inline(always)]
fn unnormalise(d: &mut [f32], gamma: &[f32], normalised: &[f32], inverse_std: f32) {
    for (d, gamma) in d.iter_mut().zip(gamma) {
        *d *= gamma;
    }
    let count = d.len() as f32;
    let mean = sum(d, d, |g, _| g) / count;
    let along = sum(d, normalised, |g, x| g * x) / count;
    for (d, x) in d.iter_mut().zip(normalised) {
        *d = inverse_std * (*d - mean - x * along);
    }
}

/// Σ term(x_i, y_i) in a fixed order that vectorises.
#[inline(always)]
fn sum(x: &[f32], y: &[f32], term: impl Fn(f32, f32) -> f32) -> f32 {
    let mut lanes = [0.0; LANES];
    let (x_wide, x_rest) = x.as_chunks::<LANES>();
    let (y_wide, y_rest) = y.as_chunks::<LANES>();
    for (x, y) in x_wide.iter().zip(y_wide) {
        for lane in 0..LANES {
            lanes[lane] += term(x[lane], y[lane]);
        }
    }
    let rest: f32 = x_rest.iter().zip(y_rest).map(|(x, y)| term(*x, *y)).sum();
    lanes.iter().sum::<f32>() + rest
}

/// Drops each element with `probability`, as a pure function of `seed`, row and column.
#[derive(Clone, Copy)]
struct DropoutMask {
    probability: f32,
    seed: u64,
}

impl DropoutMask {
    #[inline(always)]
    fn apply(self, row: usize, out: &mut [f32], slope: &mut [f32]) {
        let threshold = (f64::from(self.probability) * 2f64.powi(32)) as u32;
        let kept = 1.0 / (1.0 - self.probability);
        let start = scramble(self.seed as u32 ^ scramble((self.seed >> 32) as u32 ^ row as u32));
        for (column, (out, slope)) in out.iter_mut().zip(slope).enumerate() {
            let drawn = scramble(start.wrapping_add(column as u32));
            let factor = if drawn < threshold { 0.0 } else { kept };
            *out *= factor;
            *slope *= factor;
        }
    }
}

/// A bijection of 32-bit numbers that leaves no visible pattern (Wellons' `lowbias32`).
#[inline(always)]
fn scramble(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

#[cfg(test)]
mod tests;
