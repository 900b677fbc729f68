//! The loss: a weighted Huber error of the heads, and the penalty that keeps their first layers apart.

use super::fused::{add, numbers, view, view_mut};
use super::{FirstWeight, NetworkError, TapedBatch};
use dfdx::prelude::{
    Const, ConstDim, Cpu, Merge, OwnedTape, PutTape, Rank0, SplitTape, Tape, Tensor, TensorFromVec,
};
use ndarray::linalg::general_mat_mul;
use ndarray::{Array2, ArrayView2, Axis, s};

/// A loss that can run backwards.
type TapedLoss = Tensor<Rank0, f32, Cpu, OwnedTape<f32, Cpu>>;

/// Σ_j w_j·huber_δ(ŷ_j − y_j) + λ Σ_{j<k} ‖U_j U_kᵀ‖_F².
#[derive(Debug, Clone)]
pub(super) struct Loss {
    /// w, one for each target.
    pub(super) weights: Vec<f32>,
    /// δ.
    pub(super) delta: f32,
    /// λ.
    pub(super) orthogonality: f32,
}

impl Loss {
    /// Mean over rows of the weighted Huber errors, of predictions and targets of the same shape.
    pub(super) fn error(&self, predictions: &Array2<f32>, targets: &Array2<f32>) -> f64 {
        let rows = targets.nrows();
        let weights = self.weights.iter().cycle();
        let each = predictions.iter().zip(targets).zip(weights);
        let total: f64 = each
            .map(|((p, t), w)| f64::from(w * huber(p - t, self.delta).0))
            .sum();
        total / rows as f64
    }

    /// The mean error of a batch, and the loss whose backward pass reaches all that made the predictions.
    ///
    /// `predictions` holds one column for each head, `targets` is rows × heads, row-major. The penalty adds its gradient to the
    /// heads' first weights; its value is not part of what is returned.
    pub(super) fn taped<K: ConstDim, H: FirstWeight<K>>(
        &self,
        predictions: Vec<TapedBatch<Const<1>>>,
        targets: &[f32],
        heads: &[H],
    ) -> Result<(f64, TapedLoss), NetworkError> {
        let (outputs, rows) = (predictions.len(), targets.len() / predictions.len());
        let mut tape = OwnedTape::default();
        let mut error = 0.0;
        let mut slopes = Vec::with_capacity(outputs);
        for (j, prediction) in predictions.into_iter().enumerate() {
            let (prediction, its_tape) = prediction.split_tape();
            tape = tape.merge(its_tape);
            let weight = self.weights[j] / rows as f32;
            let column = targets[j..].iter().step_by(outputs);
            let slope: Vec<f32> = prediction
                .as_vec()
                .iter()
                .zip(column)
                .map(|(p, t)| {
                    let (value, slope) = huber(p - t, self.delta);
                    error += f64::from(weight * value);
                    weight * slope
                })
                .collect();
            slopes.push((prediction.ghost(), slope));
        }
        tape.add_backward_op(move |gradients| {
            for (prediction, slope) in &slopes {
                add(gradients.get_or_alloc_mut(prediction)?, slope);
            }
            Ok(())
        });
        if self.orthogonality > 0.0 && outputs > 1 {
            self.tape_penalty(&mut tape, heads);
        }
        let value = Cpu::default().try_tensor_from_vec(vec![error as f32], ())?;
        Ok((error, value.put_tape(tape)))
    }

    fn tape_penalty<K: ConstDim, H: FirstWeight<K>>(
        &self,
        tape: &mut OwnedTape<f32, Cpu>,
        heads: &[H],
    ) {
        let stacked: Vec<f32> = (heads.iter().map(FirstWeight::first_weight))
            .flat_map(numbers)
            .collect();
        let ids: Vec<_> = heads.iter().map(|h| h.first_weight().ghost()).collect();
        let lambda = self.orthogonality;
        tape.add_backward_op(move |gradients| {
            let slope = penalty_gradient(view(&stacked, K::SIZE), ids.len(), lambda);
            for (weight, slope) in ids
                .iter()
                .zip(slope.axis_chunks_iter(Axis(0), H::Rows::SIZE))
            {
                let mut gradient = view_mut(gradients.get_or_alloc_mut(weight)?, K::SIZE);
                gradient += &slope;
            }
            Ok(())
        });
    }
}

/// huber_δ(r) and its derivative.
fn huber(residual: f32, delta: f32) -> (f32, f32) {
    if residual.abs() < delta {
        (0.5 * residual * residual, residual)
    } else {
        // `signum` keeps a NaN, so that training notices.
        (
            delta * (residual.abs() - 0.5 * delta),
            delta * residual.signum(),
        )
    }
}

/// Gradient of λ Σ_{j<k} ‖U_j U_kᵀ‖_F² with respect to d weights U (q × p each), stacked as they are.
///
/// That with respect to U_j is 2λ Σ_{k≠j} (U_j U_kᵀ) U_k. Only the blocks j < k of the Gram matrix are computed, each weight against all
/// later ones in one product: 6·d(d−1)/2·q²p operations, the least for few heads.
fn penalty_gradient(stacked: ArrayView2<'_, f32>, heads: usize, lambda: f32) -> Array2<f32> {
    let (size, rows) = (stacked.nrows(), stacked.nrows() / heads);
    let mut gram = Array2::zeros((size, size));
    let mut gradient = Array2::zeros(stacked.dim());
    for j in 0..heads {
        let (start, end) = (j * rows, (j + 1) * rows);
        let own = stacked.slice(s![start..end, ..]);
        let mut slope = gradient.slice_mut(s![start..end, ..]);
        if j + 1 < heads {
            let later = stacked.slice(s![end.., ..]);
            let mut block = gram.slice_mut(s![start..end, end..]);
            general_mat_mul(1.0, &own, &later.t(), 0.0, &mut block);
            general_mat_mul(2.0 * lambda, &block, &later, 1.0, &mut slope);
        }
        if j > 0 {
            let (earlier, block) = (s![..start, ..], gram.slice(s![..start, start..end]));
            general_mat_mul(
                2.0 * lambda,
                &block.t(),
                &stacked.slice(earlier),
                1.0,
                &mut slope,
            );
        }
    }
    gradient
}

#[cfg(test)]
mod tests {
    use super::*;
    use dfdx::nn::DeviceBuildExt;
    use dfdx::prelude::*;

    #[test]
    fn huber_is_a_parabola_inside_and_a_line_outside() {
        assert_eq!(huber(0.5, 1.0), (0.125, 0.5));
        assert_eq!(huber(-0.5, 1.0), (0.125, -0.5));
        assert_eq!(huber(3.0, 1.0), (2.5, 1.0));
        assert_eq!(huber(-3.0, 1.0), (2.5, -1.0));
        assert!(huber(f32::NAN, 1.0).0.is_nan());
    }

    fn weights(heads: usize, rows: usize, cols: usize) -> Vec<f32> {
        (0..heads * rows * cols)
            .map(|i| ((i * i * 31 + 7 * i) % 101) as f32 / 101.0 - 0.5)
            .collect()
    }

    #[test]
    fn the_penalty_has_the_gradient_of_its_definition() {
        for (heads, rows, cols) in [(2, 3, 4), (3, 2, 5), (4, 3, 3)] {
            let u = weights(heads, rows, cols);
            let each = rows * cols;
            let value = |u: &[f32]| -> f64 {
                let row = |j: usize, r: usize| &u[j * each + r * cols..][..cols];
                let mut total = 0.0;
                for j in 0..heads {
                    for k in j + 1..heads {
                        for (r, s) in (0..rows).flat_map(|r| (0..rows).map(move |s| (r, s))) {
                            let dot: f64 = row(j, r)
                                .iter()
                                .zip(row(k, s))
                                .map(|(a, b)| f64::from(*a) * f64::from(*b))
                                .sum();
                            total += dot * dot;
                        }
                    }
                }
                total
            };
            let gradient = penalty_gradient(view(&u, cols), heads, 0.5);
            for (i, g) in gradient.iter().enumerate() {
                let (mut up, mut down) = (u.clone(), u.clone());
                up[i] += 0.01;
                down[i] -= 0.01;
                let measured = 0.5 * (value(&up) - value(&down)) / 0.02;
                assert!((f64::from(*g) - measured).abs() < 1e-4, "{g} {measured}");
            }
        }
    }

    /// The same loss written in plain dfdx operations.
    #[test]
    fn gradients_equal_those_of_the_taped_form() {
        type Head = (Linear<6, 3>, Tanh, Linear<3, 1>);
        const ROWS: usize = 5;
        let device = Cpu::seed_from_u64(1);
        let mut heads: Vec<_> = (0..3).map(|_| device.build_module::<Head, f32>()).collect();
        let x: Tensor<(usize, Const<6>), f32, _> = device.sample_normal_like(&(ROWS, Const::<6>));
        let targets: Vec<f32> = weights(3, ROWS, 1).iter().map(|t| 3.0 * t).collect();
        let loss = Loss {
            weights: vec![1.0, 0.5, 2.0],
            delta: 0.6,
            orthogonality: 0.3,
        };

        let predictions: Vec<_> = heads
            .iter_mut()
            .map(|h| h.forward_mut(x.leaky_trace()))
            .collect();
        let (error, taped) = loss.taped(predictions, &targets, &heads).unwrap();
        let ours = taped.backward();

        let mut plain: TapedLoss = device.zeros::<Rank0>().leaky_traced();
        for (j, head) in heads.iter_mut().enumerate() {
            let column: Vec<f32> = targets[j..].iter().step_by(3).copied().collect();
            let column = device.tensor_from_vec(column, (ROWS, Const::<1>));
            let prediction = head.forward_mut(x.leaky_trace());
            plain = plain + prediction.huber_error(column, 0.6).mean() * loss.weights[j];
        }
        assert!((plain.array() - error as f32).abs() < 1e-6);
        for j in 0..3 {
            for k in j + 1..3 {
                let left = heads[j].0.weight.leaky_trace();
                let right = heads[k].0.weight.retaped::<OwnedTape<f32, Cpu>>();
                plain = plain + left.matmul(right.permute()).square().sum() * 0.3;
            }
        }
        let theirs = plain.backward();
        for head in &heads {
            let close =
                |a: Vec<f32>, b: Vec<f32>| a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-5);
            let (first, last) = (&head.0.weight, &head.2.weight);
            assert!(close(ours.get(first).as_vec(), theirs.get(first).as_vec()));
            assert!(close(ours.get(last).as_vec(), theirs.get(last).as_vec()));
        }
    }
}
