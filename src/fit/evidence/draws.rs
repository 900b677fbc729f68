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
        let mut draws = self.reweighed(sample, blocks);
        let mut found = mean_weight(&draws);
        for _ in 0..BUDGET.evidence_rounds {
            if found.is_some_and(|(_, error, _)| error <= BUDGET.evidence_error) {
                break;
            }
            let round = Round::new(self.problem, &proposals, count, &mut source, log_prior)?;
            proposals = round.adapted(&first, BUDGET.kept_covariance);
            draws.extend(round.logs.into_iter().zip(round.normals));
            found = mean_weight(&draws);
        }
        let bounds = self.beyond_bounds(&self.problem.prior_terms().collect::<Vec<_>>());
        Ok(found.map(|(log, error, effective)| (log + bounds, error, effective)))
    }

    /// log of likelihood·prior/proposal at the draws of the posterior, whose likelihoods are known, each with its normal over the proposal; none
    /// where entries at a bound were drawn, too.
    fn reweighed(&self, sample: &PosteriorSample, blocks: &[SizePrior]) -> Vec<(f64, f64)> {
        let Some(round) = sample.round.as_ref().filter(|r| r.free == self.free) else {
            return vec![];
        };
        let draws = round.draws.iter().zip(&round.logs).zip(&round.normals);
        draws
            .map(|((phi, log), normal)| {
                if *log == f64::NEG_INFINITY {
                    return (*log, *normal);
                }
                let theta = self.problem.coordinates.theta(phi.as_slice());
                let weak = self.problem.log_prior(&theta, true);
                let own = self.log_prior(&phi.select_rows(&self.free), blocks);
                (log - weak + own, *normal)
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

/// log of the mean weight, its standard error, and the effective number of draws; `None` where no draw has any weight. Draws are logs of
/// weights, each with a control variate whose mean is 1: of a posterior that is nearly normal, weights are nearly in proportion to that.
///
/// ```text
/// Z = mean w − β·(mean c − 1),   β = cov(w, c)/var c
/// ```
///
/// Source: Owen, *Monte Carlo theory, methods and examples* (2013), section 8.9.
fn mean_weight(draws: &[(f64, f64)]) -> Option<(f64, f64, f64)> {
    let top = (draws.iter()).fold(f64::NEG_INFINITY, |top, (log, _)| top.max(*log));
    if !top.is_finite() {
        return None;
    }
    let weights: Vec<f64> = draws.iter().map(|(log, _)| (log - top).exp()).collect();
    let n = weights.len() as f64;
    let mean = weights.iter().sum::<f64>() / n;
    let control = draws.iter().map(|(_, c)| c).sum::<f64>() / n;
    let (mut both, mut square) = (0.0, 0.0);
    for (weight, (_, c)) in weights.iter().zip(draws) {
        both += (weight - mean) * (c - control);
        square += (c - control).powi(2);
    }
    let slope = if square > 0.0 { both / square } else { 0.0 };
    let rest: Vec<f64> = (weights.iter().zip(draws))
        .map(|(weight, (_, c))| weight - slope * (c - 1.0))
        .collect();
    let held = rest.iter().sum::<f64>() / n;
    // Few draws, of which the control tells more than there is.
    let (mean, rest) = if held > 0.0 {
        (held, &rest)
    } else {
        (mean, &weights)
    };
    let error = deviation(rest) / n.sqrt() / mean;
    Some((top + mean.ln(), error, effective(&weights)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Over 400 sets of 100 draws, the error that is told is that which they have, and a nearly normal target has a third of it, or less, of
    /// that without the control.
    #[test]
    fn a_control_takes_off_what_a_normal_explains() {
        // Under a Student of five degrees, the weight of a normal of variance 1.1, and that of Gumbel's density.
        let mut source = Noise::new(3, "control", 0).source("z");
        let student = |x: f64| -3.0 * (x * x / 5.0).ln_1p() + 0.379_606_7f64.ln();
        let normal = |x: f64, v: f64| -0.5 * x * x / v - 0.5 * (TAU * v).ln();
        let skewed = |x: f64| -x - (-x).exp();
        for (target, gain) in [
            (&(|x| normal(x, 1.1)) as &dyn Fn(f64) -> f64, 3.0),
            (&skewed, 1.0),
        ] {
            let (mut found, mut told, mut plain) = (vec![], vec![], vec![]);
            for _ in 0..400 {
                let draws: Vec<(f64, f64)> = (0..100)
                    .map(|_| {
                        let square: f64 = (0..5).map(|_| source.normal().powi(2)).sum();
                        let x = source.normal() * (5.0 / square).sqrt();
                        (target(x) - student(x), (normal(x, 1.0) - student(x)).exp())
                    })
                    .collect();
                let (log, error, _) = mean_weight(&draws).unwrap();
                let bare: Vec<(f64, f64)> = draws.iter().map(|(log, _)| (*log, 1.0)).collect();
                found.push(log);
                told.push(error);
                plain.push(mean_weight(&bare).unwrap().0);
            }
            let told = told.iter().sum::<f64>() / 400.0;
            let (own, bare) = (deviation(&found), deviation(&plain));
            assert!((0.8..1.25).contains(&(own / told)), "{own} {told}");
            assert!(own * gain < bare * 1.1, "{own} {bare}");
        }
    }
}
