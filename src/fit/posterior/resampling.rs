//! Draws of θ given the records.

use super::sampler::{Proposal, Round};
use crate::fit::climb::Fitted;
use crate::fit::problem::Problem;
use crate::likelihood::kalman::{FilterError, recoverable};
use crate::twin::Noise;
use nalgebra::DVector;

/// Samples that are filtered in one round, and draws that makes at least and at most.
const SAMPLES: usize = 200_000;
const LEAST: usize = 100;
const MOST: usize = 500;
/// Draws of the last round for each that is asked for: weights are uneven, and fewer would repeat draws.
const OVER: usize = 4;
/// Rounds of adaptation where draws are asked for; without, one.
const ROUNDS: usize = 3;
/// Share of the first round's covariance in that of the next.
const KEPT: f64 = 0.05;
/// Nats below the best top within which another counts: a mode with a thousandth of the mass is none.
const DEEP: f64 = 7.0;
/// Standard deviations between two tops of their own.
const APART: f64 = 3.0;
/// Gain in nats at which a draw is better than the fit.
const BETTER: f64 = 0.1;

/// Draws of the full θ, the weights of their round already followed.
#[derive(Debug, Clone, Default)]
pub(crate) struct Draws {
    /// Full θ of each draw.
    pub thetas: Vec<Vec<f64>>,
    /// Top that each draw belongs to.
    pub modes: Vec<usize>,
    /// Number of independent draws that these are worth.
    pub effective: f64,
    /// Densities about the tops that follow the draws.
    pub(in crate::fit) proposals: Vec<Proposal>,
    /// The best draw, where it is better than the best fit.
    pub(in crate::fit) better: Option<Vec<f64>>,
}

/// Number of draws whose time is that of a fit.
pub(in crate::fit) fn usual(problem: &Problem) -> usize {
    (SAMPLES / problem.samples()).clamp(LEAST, MOST)
}

/// `count` draws of θ, or as many as fits need, from the posterior of likelihood and weak priors within the bounds; `fits` are ends of
/// searches, best first.
///
/// Draws of Student densities about the tops are weighed by posterior over their mixture; the weighted mean and covariance about each top
/// propose a second round, as directions that the records hardly know bend; draws are taken from that in proportion to their weights.
///
/// Source: Rubin, "Using the SIR algorithm to simulate posterior distributions" (1988).
pub(crate) fn posterior(
    problem: &Problem,
    fits: &[Fitted],
    count: Option<usize>,
    noise: Noise,
) -> Result<Draws, FilterError> {
    let Some(best) = fits.first() else {
        return Ok(Draws::default());
    };
    let usual = usual(problem);
    let mut source = noise.source("draws");
    let first: Vec<Proposal> = (tops(problem, fits).into_iter())
        .filter_map(|fit| Proposal::around(problem, fit))
        .collect();
    if first.is_empty() {
        return Ok(Draws::default());
    }
    let c = &problem.coordinates;
    let log_posterior = |phi: &DVector<f64>| {
        let theta = c.theta(phi.as_slice());
        let value = recoverable(problem.log_likelihood(&theta))?;
        Ok(value.map(|l| l + problem.log_prior(&theta, true)))
    };
    let (rounds, size) = match count {
        Some(count) => (ROUNDS, usual.max(OVER * count)),
        None => (1, usual),
    };
    let mut proposals = first.clone();
    let mut round = Round::new(problem, &proposals, usual, &mut source, log_posterior)?;
    let mut better = (best.objective + BETTER, None);
    let mut look = |round: &Round| {
        if let Some((phi, value)) = round.best()
            && value > better.0
        {
            better = (value, Some(c.theta(phi.as_slice())));
        }
    };
    look(&round);
    for left in (0..rounds).rev() {
        proposals = round.adapted(&first, KEPT);
        let size = if left == 0 { size } else { usual };
        round = Round::new(problem, &proposals, size, &mut source, log_posterior)?;
        look(&round);
    }
    let taken = round.taken(count.unwrap_or(usual));
    let theta = |i: &usize| c.theta(round.draws[*i].as_slice());
    Ok(Draws {
        thetas: taken.iter().map(theta).collect(),
        modes: taken.iter().map(|i| round.modes[*i]).collect(),
        effective: round.effective(),
        proposals: round.adapted(&first, KEPT),
        better: better.1,
    })
}

/// Ends of searches that are tops of their own, best first.
fn tops<'a>(problem: &Problem, fits: &'a [Fitted]) -> Vec<&'a Fitted> {
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
