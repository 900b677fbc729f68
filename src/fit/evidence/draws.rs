//! Evidence by importance sampling.

use super::expansion::{Expansion, log_mean};
use super::sizes::SizePrior;
use crate::fit::axis::EvidencePrior;
use crate::fit::budget::BUDGET;
use crate::fit::posterior::{PosteriorSample, Proposal, Round, effective};
use crate::likelihood::kalman::FilterError;
use crate::math::deviation;
use crate::twin::Noise;
use nalgebra::DVector;
use std::f64::consts::{LN_2, TAU};

impl Expansion<'_> {
    /// log Z from draws of proposals that follow the posterior, its standard error, and the effective number of draws.
    pub(super) fn by_draws(
        &self,
        sample: &PosteriorSample,
        blocks: &[SizePrior],
        noise: Noise,
    ) -> Result<Option<(f64, f64, f64)>, FilterError> {
        let first: Vec<Proposal> = (sample.proposals.iter())
            .filter_map(|proposal| proposal.within(&self.free, &self.phi))
            .collect();
        if first.is_empty() {
            return Ok(None);
        }
        let mut proposals = first.clone();
        let count = (BUDGET.evidence_samples / self.problem.samples())
            .clamp(BUDGET.least_evidence_draws, BUDGET.most_evidence_draws);
        let log_prior = |phi: &DVector<f64>| self.log_prior(&phi.select_rows(&self.free), blocks);
        let mut source = noise.source("evidence");
        let mut logs = self.reweighed(sample, blocks);
        let mut found = mean_weight(&logs);
        for _ in 0..BUDGET.evidence_rounds {
            if found.is_some_and(|(_, error, _)| error <= BUDGET.evidence_error) {
                break;
            }
            let round = Round::new(self.problem, &proposals, count, &mut source, log_prior)?;
            proposals = round.adapted(&first, BUDGET.kept_covariance);
            logs.extend(round.logs);
            found = mean_weight(&logs);
        }
        let bounds = self.beyond_bounds(&self.problem.prior_terms().collect::<Vec<_>>());
        Ok(found.map(|(log, error, effective)| (log + bounds, error, effective)))
    }

    /// log of likelihood·prior/proposal at the draws of the posterior, whose likelihoods are known; none where entries at a bound were drawn,
    /// too.
    fn reweighed(&self, sample: &PosteriorSample, blocks: &[SizePrior]) -> Vec<f64> {
        let Some(round) = sample.round.as_ref().filter(|r| r.free == self.free) else {
            return vec![];
        };
        let draws = round.draws.iter().zip(&round.logs);
        draws
            .map(|(phi, log)| {
                if *log == f64::NEG_INFINITY {
                    return *log;
                }
                let theta = self.problem.coordinates.theta(phi.as_slice());
                let weak = self.problem.log_prior(&theta, true);
                log - weak + self.log_prior(&phi.select_rows(&self.free), blocks)
            })
            .collect()
    }

    /// log of the prior density of the free entries.
    fn log_prior(&self, phi: &DVector<f64>, blocks: &[SizePrior]) -> f64 {
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

/// log of the mean weight, its standard error, and the effective number of draws; `None` where no draw has any weight.
fn mean_weight(logs: &[f64]) -> Option<(f64, f64, f64)> {
    let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !top.is_finite() {
        return None;
    }
    let weights: Vec<f64> = logs.iter().map(|l| (l - top).exp()).collect();
    let n = weights.len() as f64;
    let mean = weights.iter().sum::<f64>() / n;
    let error = deviation(&weights) / n.sqrt() / mean;
    Some((top + mean.ln(), error, effective(&weights)))
}
