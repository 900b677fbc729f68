//! Evidence by importance sampling.

use super::expansion::{Expansion, log_mean};
use super::sizes::Block;
use crate::fit::axis::EvidencePrior;
use crate::fit::posterior::{Proposal, Round, effective};
use crate::likelihood::kalman::{FilterError, recoverable};
use crate::math::deviation;
use crate::twin::Noise;
use nalgebra::DVector;
use std::f64::consts::{LN_2, TAU};

/// Samples that are filtered in one round, and draws that makes at least and at most.
const SAMPLES: usize = 400_000;
const LEAST_DRAWS: usize = 200;
const MOST_DRAWS: usize = 1000;
/// Share of the first proposals' covariance in those that follow their draws.
const KEPT: f64 = 0.05;
/// Monte-Carlo error in nats that is small enough, and rounds for which more draws are taken at most.
const ENOUGH: f64 = 0.03;
const MOST_ROUNDS: usize = 4;

impl Expansion<'_> {
    /// log Z from draws of proposals that follow the posterior, its standard error, and the effective number of draws.
    pub(super) fn by_draws(
        &self,
        proposals: &[Proposal],
        blocks: &[Block],
        noise: Noise,
    ) -> Result<Option<(f64, f64, f64)>, FilterError> {
        let first: Vec<Proposal> = (proposals.iter())
            .filter_map(|proposal| proposal.within(&self.free, &self.phi))
            .collect();
        if first.is_empty() {
            return Ok(None);
        }
        let mut proposals = first.clone();
        let count = (SAMPLES / self.problem.samples()).clamp(LEAST_DRAWS, MOST_DRAWS);
        let log_target = |phi: &DVector<f64>| {
            let log_prior = self.log_prior(&phi.select_rows(&self.free), blocks);
            if log_prior == f64::NEG_INFINITY {
                return Ok(None);
            }
            let theta = self.problem.coordinates.theta(phi.as_slice());
            let value = recoverable(self.problem.log_likelihood(&theta))?;
            Ok(value.map(|value| value + log_prior))
        };
        let mut source = noise.source("evidence");
        let mut logs: Vec<f64> = vec![];
        let mut found = None;
        for _ in 0..MOST_ROUNDS {
            let round = Round::new(self.problem, &proposals, count, &mut source, log_target)?;
            proposals = round.adapted(&first, KEPT);
            logs.extend(round.logs);
            let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            if !top.is_finite() {
                break;
            }
            let weights: Vec<f64> = logs.iter().map(|l| (l - top).exp()).collect();
            let n = weights.len() as f64;
            let mean = weights.iter().sum::<f64>() / n;
            let error = deviation(&weights) / n.sqrt() / mean;
            found = Some((top + mean.ln(), error, effective(&weights)));
            if error <= ENOUGH {
                break;
            }
        }
        let bounds = self.beyond_bounds(&self.problem.prior_terms().collect::<Vec<_>>());
        Ok(found.map(|(log, error, effective)| (log + bounds, error, effective)))
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
