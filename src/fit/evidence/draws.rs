//! Correction of Laplace by draws around it.

use super::expansion::{Expansion, Laplace, log_mean};
use super::sizes::Block;
use crate::fit::axis::EvidencePrior;
use crate::likelihood::kalman::{FilterError, recoverable};
use crate::twin::Noise;
use nalgebra::DVector;
use rayon::prelude::*;
use std::f64::consts::{LN_2, TAU};

/// Samples that are filtered for the correction, and draws that makes at least and at most.
const SAMPLES: usize = 400_000;
const LEAST_DRAWS: usize = 200;
const MOST_DRAWS: usize = 1000;
/// Degrees of freedom of the proposal: heavier tails than the posterior's.
const FREEDOM: usize = 5;

impl Expansion<'_> {
    /// log Z from draws around a Laplace approximation, its standard error, and the effective number of draws.
    pub(super) fn by_draws(
        &self,
        around: &Laplace,
        blocks: &[Block],
        noise: Noise,
    ) -> Result<Option<(f64, f64, f64)>, FilterError> {
        let d = self.free.len();
        let Some(factor) = around.precision.clone().cholesky() else {
            return Ok(None);
        };
        let root = factor.l().transpose();
        let log_root: f64 = (0..d).map(|a| root[(a, a)].ln()).sum();
        let count = (SAMPLES / self.problem.samples()).clamp(LEAST_DRAWS, MOST_DRAWS) / 2;
        let c = &self.problem.coordinates;
        // Pairs on both sides of the centre: what is odd in the posterior cancels.
        let pairs: Vec<[f64; 2]> = (0..count as u64)
            .into_par_iter()
            .map(|i| {
                let mut source = noise.sample(i).source("evidence");
                let z = DVector::from_fn(d, |_, _| source.normal());
                let square: f64 = (0..FREEDOM).map(|_| source.normal().powi(2)).sum();
                let stretch = (FREEDOM as f64 / square).sqrt();
                let Some(step) = root.solve_upper_triangular(&(z * stretch)) else {
                    return Ok([f64::NEG_INFINITY; 2]);
                };
                let length = (&root * &step).norm_squared();
                let log_proposal = log_student(d, length) + log_root;
                let mut weights = [f64::NEG_INFINITY; 2];
                for (weight, sign) in weights.iter_mut().zip([1.0, -1.0]) {
                    let free = &around.centre + sign * &step;
                    let mut phi = self.phi.clone();
                    for (a, &j) in self.free.iter().enumerate() {
                        phi[j] = free[a];
                    }
                    let inside = (phi.iter().zip(c.lower().iter().zip(c.upper())))
                        .all(|(v, (low, high))| (low..=high).contains(&v));
                    let log_prior = self.log_prior(&free, blocks);
                    if !inside || log_prior == f64::NEG_INFINITY {
                        continue;
                    }
                    let theta = c.theta(phi.as_slice());
                    if let Some(value) = recoverable(self.problem.log_likelihood(&theta))? {
                        *weight = value + log_prior - log_proposal;
                    }
                }
                Ok(weights)
            })
            .collect::<Result<_, FilterError>>()?;
        let logs: Vec<f64> = pairs.iter().flatten().copied().collect();
        let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if !top.is_finite() {
            return Ok(None);
        }
        let weights: Vec<f64> = logs.iter().map(|l| (l - top).exp()).collect();
        let sum: f64 = weights.iter().sum();
        let effective = sum * sum / weights.iter().map(|w| w * w).sum::<f64>();
        // Pairs are not independent within themselves.
        let means: Vec<f64> = weights
            .chunks_exact(2)
            .map(|p| 0.5 * (p[0] + p[1]))
            .collect();
        let mean = sum / weights.len() as f64;
        let n = means.len() as f64;
        let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (n - 1.0);
        let error = (variance / n).sqrt() / mean;
        let bounds = self.beyond_bounds(&self.problem.prior_terms().collect::<Vec<_>>());
        Ok(Some((top + mean.ln() + bounds, error, effective)))
    }

    /// log of the prior density of the free entries.
    fn log_prior(&self, phi: &DVector<f64>, blocks: &[Block]) -> f64 {
        let prior: Vec<(f64, f64)> = self.problem.prior_terms().collect();
        let normal = |v: f64, mean: f64, precision: f64| {
            0.5 * (precision / TAU).ln() - 0.5 * precision * (v - mean).powi(2)
        };
        let of_entries: f64 = (self.free.iter().enumerate())
            .map(|(a, &j)| match self.problem.axes[j].evidence {
                EvidencePrior::Normal => normal(phi[a], prior[j].0, prior[j].1),
                EvidencePrior::Magnitude { .. } | EvidencePrior::Member => 0.0,
                EvidencePrior::Uniform { low, high } if (low..=high).contains(&phi[a]) => {
                    -(high - low).ln()
                }
                EvidencePrior::Uniform { .. } => f64::NEG_INFINITY,
            })
            .sum();
        let value = |entry: usize| self.free.iter().position(|j| *j == entry).map(|a| phi[a]);
        let of_blocks: f64 = (blocks.iter())
            .map(|block| {
                let each: Vec<f64> = (block.options.iter())
                    .map(|deviations| {
                        (block.entries.iter().zip(deviations))
                            .filter_map(|(j, d)| {
                                let half = if self.problem.axes[*j].is_one_sided() {
                                    LN_2
                                } else {
                                    0.0
                                };
                                Some(normal(value(*j)?, 0.0, d.powi(-2)) + half)
                            })
                            .sum()
                    })
                    .collect();
                log_mean(&each)
            })
            .sum();
        of_entries + of_blocks
    }
}

/// log density of a standard Student with [`FREEDOM`] degrees at squared length `square`.
fn log_student(d: usize, square: f64) -> f64 {
    let (nu, d) = (FREEDOM as f64, d as f64);
    let gamma = statrs::function::gamma::ln_gamma;
    gamma(0.5 * (nu + d))
        - gamma(0.5 * nu)
        - 0.5 * d * (nu * TAU / 2.0).ln()
        - 0.5 * (nu + d) * (square / nu).ln_1p()
}
