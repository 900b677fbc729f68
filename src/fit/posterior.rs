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
/// Draws of the last round for each that is asked for: weights are uneven, and fewer would repeat draws.
const OVER: usize = 4;
/// Rounds of adaptation where draws are asked for; without, one.
const ROUNDS: usize = 3;
/// Draws that count, for each entry of φ: weights are flattened until so many do, so that a proposal follows more than a few draws.
const COUNTING: f64 = 4.0;
/// Width of a proposal over that of the posterior.
const WIDER: f64 = 1.25;
/// Share of the first round's covariance in that of the second.
const KEPT: f64 = 0.05;
/// Nats below the best top within which another counts: a mode with a thousandth of the mass is none.
const DEEP: f64 = 7.0;
/// Standard deviations between two tops of their own.
const APART: f64 = 3.0;

/// Draws of the full θ, the weights of their round already followed.
#[derive(Debug, Clone, Default)]
pub(crate) struct Draws {
    /// Full θ of each draw.
    pub thetas: Vec<Vec<f64>>,
    /// Top that each draw belongs to.
    pub modes: Vec<usize>,
    /// Number of independent draws that these are worth.
    pub effective: f64,
}

/// `count` draws of θ, or as many as fits need, from the posterior of likelihood and weak priors within the bounds; `fits` are ends of
/// searches, best first.
///
/// Draws of normal densities around the tops are weighed by posterior over their mixture; the weighted mean and covariance about each
/// top propose a second round, as directions that the records hardly know bend; draws are taken from that in proportion to their
/// weights.
///
/// Source: Rubin, "Using the SIR algorithm to simulate posterior distributions" (1988); Cappé, Guillin, Marin & Robert, "Population
/// Monte Carlo" (2004).
pub(crate) fn posterior(
    problem: &Problem<'_>,
    fits: &[Fitted],
    count: Option<usize>,
    noise: Noise,
) -> Result<Draws, FilterError> {
    let Some(best) = fits.first() else {
        return Ok(Draws::default());
    };
    let usual = (SAMPLES / problem.samples()).clamp(LEAST, MOST);
    let mut source = noise.source("draws");
    let first: Vec<Proposal> = (tops(problem, fits).into_iter())
        .filter_map(|fit| Proposal::around(problem, fit))
        .collect();
    if first.is_empty() {
        return Ok(Draws::default());
    }
    let mut round = Round::new(problem, best, &first, usual, &mut source)?;
    let (rounds, size) = match count {
        Some(count) => (ROUNDS, usual.max(OVER * count)),
        None => (1, usual),
    };
    for left in (0..rounds).rev() {
        let adapted = |(m, first): (usize, &Proposal)| {
            let (mean, spread) = round.moments(m)?;
            Proposal::new(first.free.clone(), mean, spread + KEPT * &first.covariance)
        };
        let adapted: Vec<Option<Proposal>> = first.iter().enumerate().map(adapted).collect();
        let next: Vec<Proposal> = (adapted.into_iter().zip(&first))
            .map(|(adapted, first)| adapted.unwrap_or_else(|| first.clone()))
            .collect();
        let size = if left == 0 { size } else { usual };
        round = Round::new(problem, best, &next, size, &mut source)?;
    }
    let taken = round.taken(count.unwrap_or(usual));
    let theta = |i: &usize| problem.coordinates.theta(round.draws[*i].as_slice());
    Ok(Draws {
        thetas: taken.iter().map(theta).collect(),
        modes: taken.iter().map(|i| round.modes[*i]).collect(),
        effective: round.effective(),
    })
}

/// Ends of searches that are tops of their own, best first.
fn tops<'a>(problem: &Problem<'_>, fits: &'a [Fitted]) -> Vec<&'a Fitted> {
    let c = &problem.coordinates;
    let mut tops: Vec<&Fitted> = vec![];
    for fit in fits {
        let is_apart = |top: &&Fitted| {
            let off = DVector::from_vec(c.of(&fit.theta)) - DVector::from_vec(c.of(&top.theta));
            off.dot(&(&top.information * &off)) > APART * APART
        };
        if fit.objective > fits[0].objective - DEEP && tops.iter().all(is_apart) {
            tops.push(fit);
        }
    }
    tops
}

/// A normal density about one top, in the entries of φ that may move.
#[derive(Clone)]
struct Proposal {
    /// Entries that may move.
    free: Vec<usize>,
    /// The whole of φ.
    centre: DVector<f64>,
    /// Covariance of the entries that may move, not widened.
    covariance: DMatrix<f64>,
    /// Widened root of `covariance`.
    root: DMatrix<f64>,
    log_determinant: f64,
}

impl Proposal {
    fn around(problem: &Problem<'_>, fit: &Fitted) -> Option<Self> {
        let free: Vec<usize> = (0..fit.theta.len())
            .filter(|&j| !problem.axes[j].held)
            .collect();
        let information = fit.information.select_rows(&free).select_columns(&free);
        let centre = DVector::from_vec(problem.coordinates.of(&fit.theta));
        Self::new(free, centre, information.try_inverse()?)
    }

    fn new(free: Vec<usize>, centre: DVector<f64>, covariance: DMatrix<f64>) -> Option<Self> {
        let root = covariance.clone().cholesky()?.l() * WIDER;
        Some(Self {
            log_determinant: root.diagonal().map(f64::ln).sum(),
            free,
            centre,
            covariance,
            root,
        })
    }

    fn draw(&self, source: &mut Source) -> DVector<f64> {
        let z = DVector::from_fn(self.free.len(), |_, _| source.normal());
        let mut phi = self.centre.clone();
        for (&j, step) in self.free.iter().zip((&self.root * z).iter()) {
            phi[j] += step;
        }
        phi
    }

    /// Log-density, up to a constant that all share.
    fn log_density(&self, phi: &DVector<f64>) -> f64 {
        let off = (phi - &self.centre).select_rows(&self.free);
        match self.root.solve_lower_triangular(&off) {
            Some(z) => -0.5 * z.norm_squared() - self.log_determinant,
            None => f64::NEG_INFINITY,
        }
    }
}

/// Draws in φ with their tops and weights, not normalised.
struct Round {
    draws: Vec<DVector<f64>>,
    modes: Vec<usize>,
    weights: Vec<f64>,
    free: Vec<usize>,
}

impl Round {
    fn new(
        problem: &Problem<'_>,
        best: &Fitted,
        proposals: &[Proposal],
        count: usize,
        source: &mut Source,
    ) -> Result<Self, FilterError> {
        let draws: Vec<DVector<f64>> = (0..count)
            .map(|i| proposals[i % proposals.len()].draw(source))
            .collect();
        let c = &problem.coordinates;
        let each: Vec<(usize, f64)> = (draws.par_iter())
            .map(|phi| {
                let densities: Vec<f64> = proposals.iter().map(|q| q.log_density(phi)).collect();
                let mode = (0..densities.len())
                    .max_by(|&a, &b| densities[a].total_cmp(&densities[b]))
                    .unwrap_or(0);
                // Beyond the bounds nothing is possible.
                if c.clamp(phi) != *phi {
                    return Ok((mode, f64::NEG_INFINITY));
                }
                let theta = c.theta(phi.as_slice());
                let likelihood = recoverable(problem.log_likelihood(&theta))?;
                let posterior = likelihood.map(|l| l + problem.log_prior(&theta, true));
                let top = densities[mode];
                let mixture = top + densities.iter().map(|d| (d - top).exp()).sum::<f64>().ln();
                let log = posterior.map_or(f64::NEG_INFINITY, |p| p - best.objective - mixture);
                Ok((mode, log))
            })
            .collect::<Result<_, FilterError>>()?;
        let top = each.iter().fold(f64::NEG_INFINITY, |top, e| top.max(e.1));
        Ok(Self {
            draws,
            modes: each.iter().map(|(mode, _)| *mode).collect(),
            weights: each.iter().map(|(_, log)| (log - top).exp()).collect(),
            free: proposals.first().map_or(vec![], |q| q.free.clone()),
        })
    }

    /// (Σw)²/Σw².
    fn effective(&self) -> f64 {
        effective(&self.weights)
    }

    /// Weighted mean (the whole of φ) and covariance (of the entries that may move) of the draws about one top, weights flattened; `None`
    /// where no flattening makes enough of them count.
    fn moments(&self, mode: usize) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let own: Vec<(&DVector<f64>, f64)> = (0..self.draws.len())
            .filter(|&i| self.modes[i] == mode)
            .map(|i| (&self.draws[i], self.weights[i]))
            .collect();
        let d = self.free.len();
        let weights = flattened(own.iter().map(|(_, w)| *w).collect(), COUNTING * d as f64)?;
        let sum: f64 = weights.iter().sum();
        let own: Vec<_> = own.iter().map(|(x, _)| *x).zip(&weights).collect();
        let zeros = DVector::zeros(own.first()?.0.len());
        let mean = (own.iter()).fold(zeros, |m, (x, w)| m + *x * (**w / sum));
        let spread = own.iter().fold(DMatrix::zeros(d, d), |c, (x, w)| {
            let off = (*x - &mean).select_rows(&self.free);
            c + &off * off.transpose() * (**w / sum)
        });
        Some((mean, spread))
    }

    /// Indices of draws, each as often as its weight says.
    fn taken(&self, count: usize) -> Vec<usize> {
        let cumulated: Vec<f64> = (self.weights.iter())
            .scan(0.0, |sum, w| {
                *sum += w;
                Some(*sum)
            })
            .collect();
        let whole = cumulated.last().copied().unwrap_or(0.0);
        if !whole.is_finite() {
            return vec![];
        }
        (0..count)
            .map(|i| whole * (i as f64 + 0.5) / count as f64)
            .map(|at| cumulated.partition_point(|sum| *sum < at))
            .filter(|i| *i < self.draws.len())
            .collect()
    }
}

/// Weights to the largest power up to 1 at which `least` draws count; `None` where none is enough.
fn flattened(weights: Vec<f64>, least: f64) -> Option<Vec<f64>> {
    let power = |p: f64| -> Vec<f64> { weights.iter().map(|w| w.powf(p)).collect() };
    if effective(&weights) >= least {
        return Some(weights);
    }
    // Weights of 0 stay at 0: those beyond the bounds never count.
    let possible = weights.iter().filter(|w| **w > 0.0).count() as f64;
    if possible < least {
        return None;
    }
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..20 {
        let middle = 0.5 * (low + high);
        match effective(&power(middle)) >= least {
            true => low = middle,
            false => high = middle,
        }
    }
    Some(power(low.max(f64::MIN_POSITIVE)))
}

fn effective(weights: &[f64]) -> f64 {
    let sum: f64 = weights.iter().sum();
    sum * sum / weights.iter().map(|w| w * w).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Draws are taken as often as their weights say, and nothing is made of a single heavy one.
    #[test]
    fn weights_are_frequencies() {
        let round = |weights: Vec<f64>| Round {
            draws: (0..weights.len())
                .map(|i| DVector::from_element(1, (i % 4) as f64))
                .collect(),
            modes: vec![0; weights.len()],
            weights,
            free: vec![0],
        };
        let even = round([1.0, 0.0, 2.0, 1.0].repeat(2));
        let taken = even.taken(80);
        for (draw, times) in (0..4).zip([10, 0, 20, 10]) {
            assert_eq!(taken.iter().filter(|t| **t == draw).count(), times);
        }
        let (mean, spread) = even.moments(0).unwrap();
        assert!((mean[0] - 1.75).abs() < 1e-12 && (spread[(0, 0)] - 1.1875).abs() < 1e-12);
        let heavy = round(vec![1.0, 0.0, 1e-9, 0.0]);
        assert!(heavy.moments(0).is_none());
        let flat = flattened(vec![1.0, 0.0, 1e-9, 1e-6, 1e-3], 3.0).unwrap();
        assert!((effective(&flat) - 3.0).abs() < 0.01 && flat[1] == 0.0);
    }

    #[test]
    fn a_proposal_has_the_density_of_its_draws() {
        let covariance = DMatrix::from_row_slice(2, 2, &[4.0, 1.0, 1.0, 2.0]);
        let centre = DVector::from_vec(vec![1.0, 7.0, -1.0]);
        let proposal = Proposal::new(vec![0, 2], centre, covariance.clone()).unwrap();
        let mut source = Noise::new(1, "proposal", 0).source("z");
        let draws: Vec<DVector<f64>> = (0..4000).map(|_| proposal.draw(&mut source)).collect();
        assert!(draws.iter().all(|phi| phi[1] == 7.0), "held entries stay");
        let variance = draws.iter().map(|phi| (phi[0] - 1.0).powi(2)).sum::<f64>() / 4000.0;
        assert!(
            (variance / (4.0 * WIDER * WIDER) - 1.0).abs() < 0.1,
            "{variance}"
        );
        // −½ dᵀΣ⁻¹d/1.25² beside the value at the centre.
        let off = DVector::from_vec(vec![1.0, 2.0]);
        let mut phi = proposal.centre.clone();
        (phi[0], phi[2]) = (2.0, 1.0);
        let expected = -0.5 * off.dot(&(covariance.try_inverse().unwrap() * &off)) / WIDER.powi(2);
        let found = proposal.log_density(&phi) - proposal.log_density(&proposal.centre);
        assert!((found - expected).abs() < 1e-12);
    }
}
