//! The element-wise half of a fused layer, forwards and backwards, on plain slices.
//!
//! After the product z = xWᵀ a layer computes, row by row,
//!
//! ```text
//! z ← z + bias
//! z ← γ·x̂ + β,  x̂ = (z − mean z)/√(var z + ε)     where the layer is normalised
//! a = activation(z)
//! out = a·mask/(1 − p)                            mask: 0 with probability p, else 1
//! ```
//!
//! Loops are compiled for the widest vectors of the processor. Sums run in sixteen lanes whatever that width is, so
//! that it does not change their bits.

use super::activation::Activation;
use crate::math::widest;

/// Added to the variance, as in dfdx and PyTorch.
const EPSILON: f32 = 1e-5;
const LANES: usize = 16;

/// Scale γ and shift β of a layer normalisation.
#[derive(Clone, Copy)]
pub(super) struct Affine<'a> {
    pub(super) gamma: &'a [f32],
    pub(super) beta: &'a [f32],
}

/// Drops each element with `probability`, as a pure function of `seed`, row and column.
#[derive(Clone, Copy)]
pub(super) struct Mask {
    pub(super) probability: f32,
    pub(super) seed: u64,
}

/// Results of the forward pass that the backward pass needs.
pub(super) struct Saved {
    /// x̂, rows × outputs; empty without normalisation.
    normalised: Vec<f32>,
    /// 1/√(var + ε) of each row; empty without normalisation.
    inverse_std: Vec<f32>,
    /// d out/d (input of the activation), rows × outputs.
    slope: Vec<f32>,
}

/// Gradients of a layer's vectors; `gamma` and `beta` are empty without normalisation.
pub(super) struct VectorGradients {
    pub(super) bias: Vec<f32>,
    pub(super) gamma: Vec<f32>,
    pub(super) beta: Vec<f32>,
}

/// Turns `z` = xWᵀ (rows × outputs) into the layer's output, in place.
pub(super) fn forward<A: Activation>(
    z: &mut [f32],
    bias: &[f32],
    affine: Option<Affine>,
    mask: Option<Mask>,
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
            for (z, b) in z.iter_mut().zip(bias) {
                *z += b;
            }
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
pub(super) fn backward(
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
                add_product(&mut sums.gamma, d, normalised);
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
pub(in crate::network) fn add(sums: &mut [f32], x: &[f32]) {
    for (sum, x) in sums.iter_mut().zip(x) {
        *sum += x;
    }
}

#[inline(always)]
fn add_product(sums: &mut [f32], x: &[f32], y: &[f32]) {
    for ((sum, x), y) in sums.iter_mut().zip(x).zip(y) {
        *sum += x * y;
    }
}

/// z ← γx̂ + β with x̂ left in `normalised`; returns 1/√(var z + ε).
#[inline(always)]
fn normalise(z: &mut [f32], affine: Affine, normalised: &mut [f32]) -> f32 {
    let count = z.len() as f32;
    let mean = sum(z, z, |v, _| v) / count;
    let variance = sum(z, z, |v, _| (v - mean) * (v - mean)) / count;
    let inverse_std = 1.0 / (variance + EPSILON).sqrt();
    let scale_shift = affine.gamma.iter().zip(affine.beta);
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

impl Mask {
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
mod tests {
    use super::*;
    use dfdx::prelude::ReLU;

    fn dropped(rows: usize, outputs: usize, probability: f32, seed: u64) -> Vec<f32> {
        let mut z = vec![1.0; rows * outputs];
        let mask = Mask { probability, seed };
        forward::<ReLU>(&mut z, &vec![0.0; outputs], None, Some(mask));
        z
    }

    #[test]
    fn dropout_has_its_rate_and_keeps_the_mean() {
        for p in [0.1f32, 0.15, 0.5] {
            let out = dropped(1000, 200, p, 7);
            let n = out.len() as f64;
            let zeros = out.iter().filter(|v| **v == 0.0).count() as f64;
            let sigma = (n * f64::from(p) * f64::from(1.0 - p)).sqrt();
            assert!(
                (zeros - n * f64::from(p)).abs() < 4.0 * sigma,
                "{p}: {zeros}"
            );
            let kept = 1.0 / (1.0 - p);
            assert!(out.iter().all(|v| *v == 0.0 || *v == kept));
        }
    }

    #[test]
    fn neighbours_in_row_column_and_seed_are_dropped_independently() {
        let (rows, outputs) = (400, 256);
        let a = dropped(rows, outputs, 0.5, 1 << 40);
        let b = dropped(rows, outputs, 0.5, (1 << 40) + 1);
        assert_eq!(a, dropped(rows, outputs, 0.5, 1 << 40));
        let agreement = |x: &[f32], y: &[f32]| {
            x.iter().zip(y).filter(|(x, y)| x == y).count() as f64 / y.len() as f64
        };
        // One standard deviation of an agreement is 0.0016.
        for (what, share) in [
            ("seed", agreement(&a, &b)),
            ("row", agreement(&a, &a[outputs..])),
            ("column", agreement(&a, &a[1..])),
        ] {
            assert!((share - 0.5).abs() < 0.008, "{what}: {share}");
        }
    }

    #[test]
    fn rows_are_normalised() {
        let (gamma, beta) = (vec![1.0; 37], vec![0.0; 37]);
        let mut z: Vec<f32> = (0..74).map(|i| (i * i % 23) as f32).collect();
        let affine = Affine {
            gamma: &gamma,
            beta: &beta,
        };
        let saved = forward::<ReLU>(&mut z, &[0.5; 37], Some(affine), None);
        for row in saved.normalised.chunks_exact(37) {
            let mean: f32 = row.iter().sum::<f32>() / 37.0;
            let square: f32 = row.iter().map(|v| v * v).sum::<f32>() / 37.0;
            assert!(mean.abs() < 1e-5 && (square - 1.0).abs() < 1e-4);
        }
    }
}
