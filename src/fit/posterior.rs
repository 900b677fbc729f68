//! Draws of θ given the records.

use crate::fit::climb::Fitted;
use crate::fit::problem::Problem;
use crate::likelihood::kalman::{FilterError, recoverable};
use crate::twin::{Noise, Source};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Samples that are filtered in one round, and draws that makes at least and at most.
const SAMPLES: usize = 200_000;
const LEAST: usize = 100;
const MOST: usize = 500;
/// Width of the proposal over that of the posterior.
const WIDER: f64 = 1.25;
/// Share of the first round's covariance in that of the second.
const KEPT: f64 = 0.05;

/// Draws of θ of the first record, from the posterior of likelihood and weak priors within the bounds.
///
/// Normal draws around the fit are weighed by posterior over proposal; their weighted mean and covariance propose a second round, as
/// directions that the records hardly know bend; draws are taken from that in proportion to their weights.
///
/// Source: Rubin, "Using the SIR algorithm to simulate posterior distributions" (1988); Cappé, Guillin, Marin & Robert, "Population
/// Monte Carlo" (2004).
pub(crate) fn posterior(
    problem: &Problem<'_>,
    fitted: &Fitted,
    noise: Noise,
) -> Result<Vec<Vec<f64>>, FilterError> {
    let centre = DVector::from_vec(problem.coordinates.of(&fitted.theta));
    let Some(covariance) = fitted.information.clone().try_inverse() else {
        return Ok(vec![]);
    };
    let count = (SAMPLES / problem.samples()).clamp(LEAST, MOST);
    let mut source = noise.source("draws");
    let Some(first) = Proposal::new(centre, &covariance) else {
        return Ok(vec![]);
    };
    let round = first.round(problem, fitted, count, &mut source)?;
    let second = round
        .moments()
        .and_then(|(mean, spread)| Proposal::new(mean, &(spread + KEPT * &covariance)));
    let round = match second {
        Some(second) => second.round(problem, fitted, count, &mut source)?,
        None => round,
    };
    let taken = round.taken(count).into_iter();
    Ok(taken
        .map(|phi| problem.of_record(0, &problem.coordinates.theta(phi.as_slice())))
        .collect())
}

/// A normal density, widened.
struct Proposal {
    centre: DVector<f64>,
    root: DMatrix<f64>,
}

/// Draws in φ with their weights, not normalised.
struct Round {
    draws: Vec<DVector<f64>>,
    weights: Vec<f64>,
}

impl Proposal {
    fn new(centre: DVector<f64>, covariance: &DMatrix<f64>) -> Option<Self> {
        let root = covariance.clone().cholesky()?.l() * WIDER;
        Some(Self { centre, root })
    }

    fn round(
        &self,
        problem: &Problem<'_>,
        fitted: &Fitted,
        count: usize,
        source: &mut Source,
    ) -> Result<Round, FilterError> {
        let c = &problem.coordinates;
        let drawn: Vec<(DVector<f64>, f64)> = (0..count)
            .map(|_| {
                let z = DVector::from_fn(self.centre.len(), |_, _| source.normal());
                let phi = c.clamp(&(&self.centre + &self.root * &z));
                (phi, 0.5 * z.norm_squared())
            })
            .collect();
        let logs: Vec<f64> = (drawn.par_iter())
            .map(|(phi, own)| {
                let theta = c.theta(phi.as_slice());
                let likelihood = recoverable(problem.log_likelihood(&theta))?;
                let posterior = likelihood.map(|l| l + problem.log_prior(&theta, true));
                Ok(posterior.map_or(f64::NEG_INFINITY, |p| p - fitted.objective + own))
            })
            .collect::<Result<_, FilterError>>()?;
        let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Ok(Round {
            draws: drawn.into_iter().map(|(phi, _)| phi).collect(),
            weights: logs.into_iter().map(|w| (w - top).exp()).collect(),
        })
    }
}

impl Round {
    /// Weighted mean and covariance; `None` where a few draws hold all the weight.
    fn moments(&self) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let d = self.draws.first()?.len();
        let sum: f64 = self.weights.iter().sum();
        let squares: f64 = self.weights.iter().map(|w| w * w).sum();
        let effective = sum * sum / squares;
        if effective.is_nan() || effective <= 2.0 * d as f64 {
            return None;
        }
        let each = || self.draws.iter().zip(&self.weights);
        let mean = each().fold(DVector::zeros(d), |m, (x, w)| m + x * (w / sum));
        let spread = each().fold(DMatrix::zeros(d, d), |c, (x, w)| {
            let off = x - &mean;
            c + &off * off.transpose() * (w / sum)
        });
        Some((mean, spread))
    }

    /// Resamples draws by their weights.
    fn taken(&self, count: usize) -> Vec<&DVector<f64>> {
        let cumulated: Vec<f64> = (self.weights.iter())
            .scan(0.0, |sum, w| {
                *sum += w;
                Some(*sum)
            })
            .collect();
        let whole = cumulated.last().copied().unwrap_or(0.0);
        (0..count)
            .filter_map(|i| {
                let at = whole * (i as f64 + 0.5) / count as f64;
                self.draws.get(cumulated.partition_point(|sum| *sum < at))
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Draws are taken as often as their weights say, and nothing is made of a single heavy one.
    #[test]
    fn weights_are_frequencies() {
        let draws: Vec<DVector<f64>> = (0..4)
            .map(|i| DVector::from_element(1, f64::from(i)))
            .collect();
        let round = Round {
            draws: draws.clone(),
            weights: vec![1.0, 0.0, 2.0, 1.0],
        };
        let taken = round.taken(40);
        for (draw, times) in draws.iter().zip([10, 0, 20, 10]) {
            assert_eq!(taken.iter().filter(|t| **t == draw).count(), times);
        }
        let (mean, spread) = round.moments().unwrap();
        assert!((mean[0] - 1.75).abs() < 1e-12 && (spread[(0, 0)] - 1.1875).abs() < 1e-12);
        let heavy = Round {
            draws,
            weights: vec![1.0, 0.0, 1e-9, 0.0],
        };
        assert!(heavy.moments().is_none());
    }
}
