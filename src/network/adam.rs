//! Adam over the tensors of dfdx modules, its state in plain vectors.

use super::NetworkError;
use crate::math::widest;
use dfdx::nn::tensor_collection::{
    RecursiveWalker, TensorCollection, TensorOptions, TensorVisitor, ViewTensorMut,
};
use dfdx::prelude::{Cpu, Gradients, HasShape, Shape, Tensor};

const BETA1: f32 = 0.9;
const BETA2: f32 = 0.999;
const EPSILON: f32 = 1e-8;
/// Gradients, weights and first moments below this count as zero, second moments below its square: far below [`EPSILON`] they move
/// nothing, and as subnormal numbers, where dead units decay, they would cost most of the training's time.
const NOTHING: f32 = 1e-17;

/// Adam (Kingma & Ba 2015) with plain L2 weight decay, as PyTorch's `Adam`.
///
/// ```text
/// g ← g + c·w
/// m ← β₁m + (1−β₁)g,   v ← β₂v + (1−β₂)g²
/// w ← w − η·(m/(1−β₁ᵗ)) / (√(v/(1−β₂ᵗ)) + 1e-8)
/// ```
///
/// dfdx's own keeps its moments to itself. Here weights, moments and the step number are the whole state of training.
#[derive(Debug, Clone, Default)]
pub(super) struct Adam {
    /// Steps taken, t.
    pub(super) steps: i32,
    weight_decay: f32,
    /// One for each tensor, in visiting order.
    pub(super) moments: Vec<AdamMoments>,
}

/// The moving averages of a tensor's gradient and of its square.
#[derive(Debug, Clone, Default)]
pub(super) struct AdamMoments {
    pub first: Vec<f32>,
    pub second: Vec<f32>,
}

impl Adam {
    pub(super) fn new(weight_decay: f64) -> Self {
        Self {
            weight_decay: weight_decay as f32,
            ..Self::default()
        }
    }

    /// Begins a step; each module that trains then [updates](AdamStep::update), always in the same order.
    pub(super) fn step<'a>(
        &'a mut self,
        learning_rate: f64,
        gradients: &'a mut Gradients<f32, Cpu>,
    ) -> AdamStep<'a> {
        self.steps += 1;
        let unbias = |beta: f32| 1.0 / (1.0 - f64::from(beta).powi(self.steps));
        AdamStep {
            rate: (learning_rate * unbias(BETA1)) as f32,
            unbias_second: unbias(BETA2) as f32,
            next: 0,
            adam: self,
            gradients,
        }
    }
}

/// One step of [`Adam`], under way.
pub(super) struct AdamStep<'a> {
    /// η/(1−β₁ᵗ).
    rate: f32,
    /// 1/(1−β₂ᵗ).
    unbias_second: f32,
    next: usize,
    adam: &'a mut Adam,
    gradients: &'a mut Gradients<f32, Cpu>,
}

impl AdamStep<'_> {
    /// Moves the tensors of `module`.
    pub(super) fn update<M: TensorCollection<f32, Cpu>>(
        &mut self,
        module: &mut M,
    ) -> Result<(), NetworkError> {
        M::iter_tensors(&mut RecursiveWalker { m: module, f: self })?;
        Ok(())
    }
}

impl TensorVisitor<f32, Cpu> for AdamStep<'_> {
    type Viewer = ViewTensorMut;
    type Err = NetworkError;
    type E2 = f32;
    type D2 = Cpu;

    fn visit<S: Shape>(
        &mut self,
        options: TensorOptions<S, f32, Cpu>,
        tensor: &mut Tensor<S, f32, Cpu>,
    ) -> Result<Option<Tensor<S, f32, Cpu>>, NetworkError> {
        if !options.do_gradient_update {
            return Ok(None);
        }
        let count = tensor.shape().num_elements();
        if self.adam.moments.len() == self.next {
            self.adam.moments.push(AdamMoments {
                first: vec![0.0; count],
                second: vec![0.0; count],
            });
        }
        let moments = &mut self.adam.moments[self.next];
        self.next += 1;

        // The gradient is not needed afterwards: its place takes the new weights.
        let weights = super::fused::numbers(tensor);
        let gradient = self.gradients.get_or_alloc_mut(tensor)?;
        let (decay, rate, unbias_second) = (self.adam.weight_decay, self.rate, self.unbias_second);
        let each = gradient
            .iter_mut()
            .zip(&weights)
            .zip(moments.first.iter_mut().zip(&mut moments.second));
        widest(|| {
            for ((g, w), (m, v)) in each {
                let slope = kept(*g + decay * w, NOTHING);
                *m = kept(BETA1 * *m + (1.0 - BETA1) * slope, NOTHING);
                *v = kept(
                    BETA2 * *v + (1.0 - BETA2) * slope * slope,
                    NOTHING * NOTHING,
                );
                *g = w - rate * *m / ((*v * unbias_second).sqrt() + EPSILON);
                *g = kept(*g, NOTHING);
            }
        });
        tensor.copy_from(gradient);
        Ok(None)
    }
}

/// The value, or zero below `least`; NaN stays.
#[inline(always)]
fn kept(value: f32, least: f32) -> f32 {
    if value.abs() < least { 0.0 } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dfdx::nn::{DeviceBuildExt, Module};
    use dfdx::prelude::{Backward, Linear, SumTo, Trace};
    use dfdx::tensor::TensorFrom;

    /// The moves of one weight whose gradient is 2, 2, 2, …: by the formula, in 64 bits.
    #[test]
    fn steps_follow_the_formula() {
        let device = Cpu::default();
        let mut module = device.build_module::<Linear<1, 1>, f32>();
        module.weight = device.tensor([[0.5]]);
        module.bias = device.tensor([0.0]);
        let (decay, rate) = (0.1, 0.05);
        let mut adam = Adam::new(decay);
        let (mut w, mut m, mut v) = (0.5f64, 0.0, 0.0);
        for t in 1..=20 {
            let loss = module.forward(device.tensor([2.0f32]).leaky_traced()).sum();
            let mut gradients = loss.backward();
            adam.step(rate, &mut gradients).update(&mut module).unwrap();
            let g = 2.0 + decay * w;
            m = 0.9 * m + 0.1 * g;
            v = 0.999 * v + 0.001 * g * g;
            let (m_hat, v_hat) = (m / (1.0 - 0.9f64.powi(t)), v / (1.0 - 0.999f64.powi(t)));
            w -= rate * m_hat / (v_hat.sqrt() + 1e-8);
            assert!(
                (f64::from(module.weight.as_vec()[0]) - w).abs() < 1e-5,
                "step {t}"
            );
        }
    }

    #[test]
    fn weight_decay_shrinks_a_weight_without_gradient() {
        let mut module = Cpu::default().build_module::<Linear<3, 2>, f32>();
        let norm = |m: &dfdx::nn::modules::Linear<3, 2, f32, Cpu>| -> f32 {
            m.weight.as_vec().iter().map(|w| w * w).sum()
        };
        let before = norm(&module);
        let mut adam = Adam::new(0.01);
        for _ in 0..20 {
            let mut none = Gradients::leaky();
            adam.step(1e-3, &mut none).update(&mut module).unwrap();
        }
        assert!(norm(&module) < before);
    }

    /// Without gradient, weight decay alone takes weights and moments to zero: no number stays subnormal.
    #[test]
    fn nothing_decays_into_subnormal_numbers() {
        let mut module = Cpu::default().build_module::<Linear<8, 8>, f32>();
        let mut adam = Adam::new(1e-5);
        for _ in 0..3000 {
            let mut none = Gradients::leaky();
            adam.step(1e-3, &mut none).update(&mut module).unwrap();
        }
        let moments = adam
            .moments
            .iter()
            .flat_map(|m| m.first.iter().chain(&m.second));
        let weights = module.weight.as_vec();
        assert!(!moments.chain(&weights).any(|v| v.is_subnormal()));
    }
}
