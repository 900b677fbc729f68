//! Evidence by importance sampling.

use super::expansion::Expansion;
use super::sizes::SizePrior;
use crate::fit::axis::EvidencePrior;
use crate::fit::budget::BUDGET;
use crate::fit::posterior::{PosteriorSample, Proposal, Round, effective};
use crate::likelihood::kalman::FilterError;
use crate::math::{deviation, log_mean};
use crate::twin::Noise;
use nalgebra::{DMatrix, DVector};
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
        let mut draws = self.reweighed(sample, blocks);
        let mut found = draws.mean();
        for _ in 0..BUDGET.evidence_rounds {
            if found.is_some_and(|(_, error, _)| error <= BUDGET.evidence_error) {
                break;
            }
            let round = Round::new(self.problem, &proposals, count, &mut source, log_prior)?;
            proposals = round.adapted(&first, BUDGET.kept_covariance);
            draws.add(&round, round.logs.iter().copied());
            found = draws.mean();
        }
        let bounds = self.beyond_bounds(&self.problem.prior_terms().collect::<Vec<_>>());
        Ok(found.map(|(log, error, effective)| (log + bounds, error, effective)))
    }

    /// Weights of likelihood·prior at the draws of the posterior, whose likelihoods are known; none where entries at a bound were drawn, too.
    fn reweighed(&self, sample: &PosteriorSample, blocks: &[SizePrior]) -> Weighed {
        let mut draws = Weighed::default();
        let Some(round) = sample.round.as_ref().filter(|r| r.free == self.free) else {
            return draws;
        };
        let log = |(phi, log): (&DVector<f64>, &f64)| {
            if *log == f64::NEG_INFINITY {
                return *log;
            }
            let theta = self.problem.coordinates.theta(phi.as_slice());
            let weak = self.problem.log_prior(&theta, true);
            log - weak + self.log_prior(&phi.select_rows(&self.free), blocks)
        };
        draws.add(round, round.draws.iter().zip(&round.logs).map(log));
        draws
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

/// Weights of draws, with control variates whose mean is 0.
///
/// ```text
/// Z = mean w − βᵀ·mean c,   β: regression of w on c
/// ```
///
/// Source: Owen, *Monte Carlo theory, methods and examples* (2013), section 8.9.
#[derive(Default)]
struct Weighed {
    /// log of each weight.
    logs: Vec<f64>,
    controls: Vec<Vec<f64>>,
}

impl Weighed {
    /// Adds the draws of a round, with the logs of their weights.
    fn add(&mut self, round: &Round, logs: impl Iterator<Item = f64>) {
        self.logs.extend(logs);
        // Of so many draws the error is small without.
        if self.logs.len() <= BUDGET.controlled_draws {
            let controls = (0..round.draws.len()).map(|i| round.controls(i));
            self.controls.extend(controls);
        }
    }

    /// log of the mean weight, its standard error, and the effective number of draws; `None` where no draw has any weight.
    fn mean(&self) -> Option<(f64, f64, f64)> {
        let top = self.logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if !top.is_finite() {
            return None;
        }
        let weights: Vec<f64> = self.logs.iter().map(|log| (log - top).exp()).collect();
        let n = weights.len() as f64;
        let mean = weights.iter().sum::<f64>() / n;
        let error = deviation(&weights) / n.sqrt();
        // Few draws may lead to less than nothing.
        let (mean, error) = (self.controlled(&weights, mean))
            .filter(|(held, left)| *held > 0.0 && *left < error)
            .unwrap_or((mean, error));
        Some((top + mean.ln(), error / mean, effective(&weights)))
    }

    /// The mean of what controls leave of the weights, and its standard error; `None` for few draws.
    fn controlled(&self, weights: &[f64], mean: f64) -> Option<(f64, f64)> {
        if self.controls.len() < weights.len() {
            return None;
        }
        let n = weights.len();
        let count = (n / BUDGET.draws_a_control).min(self.controls.first()?.len());
        let means = DVector::from_fn(count, |j, _| {
            self.controls.iter().map(|c| c[j]).sum::<f64>() / n as f64
        });
        let off = DMatrix::from_fn(n, count, |i, j| self.controls[i][j] - means[j]);
        let own = DVector::from_fn(n, |i, _| weights[i] - mean);
        let slopes = off.tr_mul(&off).cholesky()?.solve(&off.tr_mul(&own));
        let left = own - off * &slopes;
        let freedom = n.checked_sub(count + 1).filter(|f| *f > 0)? as f64;
        let error = (left.norm_squared() / freedom / n as f64).sqrt();
        Some((mean - slopes.dot(&means), error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Over 400 sets of 300 draws, the error that is told is that which they have; a wide normal and a skewed target have at most a third of that
    /// without controls.
    #[test]
    fn controls_take_off_what_is_nearly_normal() {
        let normal = |x: f64| -0.5 * x * x / 1.5 - 0.5 * (TAU * 1.5).ln();
        // The logarithm of a sum of six squares, near its top.
        let skewed = |x: f64| {
            let (k, v) = (3.0, x / 3f64.sqrt());
            k * v - k * v.exp() + k - 0.5 * TAU.ln()
        };
        let centre = DVector::zeros(1);
        let proposal = Proposal::new(vec![0], centre, DMatrix::identity(1, 1)).unwrap();
        let mut source = Noise::new(3, "control", 0).source("z");
        for target in [&normal as &dyn Fn(f64) -> f64, &skewed] {
            let (mut found, mut told, mut plain) = (vec![], vec![], vec![]);
            for _ in 0..400 {
                let round = Round::of_target(&proposal, 300, &mut source, target);
                let mut draws = Weighed::default();
                draws.add(&round, round.logs.iter().copied());
                let (log, error, _) = draws.mean().unwrap();
                found.push(log);
                told.push(error);
                draws.controls.clear();
                plain.push(draws.mean().unwrap().0);
            }
            let told = told.iter().sum::<f64>() / told.len() as f64;
            let (own, bare) = (deviation(&found), deviation(&plain));
            assert!((0.7..1.5).contains(&(own / told)), "{own} {told}");
            assert!(3.0 * own < bare, "{own} {bare}");
        }
    }
}
