//! Activations that a fused layer computes inside itself.

use dfdx::prelude::{Dtype, Module, ReLU, Tanh, Tape, Tensor, TryPReLU};
use dfdx::shapes::Shape;
use dfdx::tensor_ops::Device;
use std::fmt::Debug;

/// The element-wise function of [`Dense`](super::Dense) and [`NormDense`](super::NormDense), named as a type.
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

const LEAK: f32 = 0.01;

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
        let z = z.clamp(-7.905_311, 7.905_311);
        let s = z * z;
        let mut p = -2.760_768_5e-16;
        for coefficient in [
            2.000_188e-13,
            -8.604_672e-11,
            5.122_297e-8,
            1.485_722_4e-5,
            6.372_619_3e-4,
            4.893_524_6e-3,
        ] {
            p = p * s + coefficient;
        }
        let mut q = 1.198_258_4e-6;
        for coefficient in [1.185_347_1e-4, 2.268_434_6e-3, 4.893_525e-3] {
            q = q * s + coefficient;
        }
        z * p / q
    }

    #[inline(always)]
    fn slope(value: f32) -> f32 {
        1.0 - value * value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fast_tanh_is_tanh() {
        let worst = (-120_000..=120_000)
            .map(|i| i as f32 * 1e-4)
            .map(|z| (<Tanh as Activation>::value(z) - (z as f64).tanh() as f32).abs())
            .fold(0.0, f32::max);
        assert!(worst < 5e-7, "{worst}");
        assert!(<Tanh as Activation>::value(f32::NAN).is_nan());
    }

    #[test]
    fn slopes_are_derivatives() {
        fn check<A: Activation>() {
            for z in [-2.0f32, -0.3, 0.4, 1.5] {
                let h = 1e-2;
                let measured = (A::value(z + h) - A::value(z - h)) / (2.0 * h);
                assert!((A::slope(A::value(z)) - measured).abs() < 1e-3, "{z}");
            }
        }
        check::<ReLU>();
        check::<Leaky>();
        check::<Tanh>();
    }
}
