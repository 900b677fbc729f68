//! Draws of θ given the records.

use super::sampler::{Proposal, Round};
use crate::fit::budget::BUDGET;
use crate::fit::climb::Fitted;
use crate::fit::problem::Problem;
use crate::likelihood::kalman::FilterError;
use crate::twin::Noise;
use nalgebra::DVector;

/// Draws of the full θ, the weights of their round already followed.
#[derive(Debug, Clone, Default)]
pub(crate) struct PosteriorSample {
    /// Full θ of each draw.
    pub thetas: Vec<Vec<f64>>,
    /// Top that each draw belongs to.
    pub modes: Vec<usize>,
    /// Number of independent draws that these are worth.
    pub effective: f64,
    /// Densities about the tops that follow the draws.
    pub(in crate::fit) proposals: Vec<Proposal>,
    /// The last round, before draws are taken from it.
    pub(in crate::fit) round: Option<Round>,
    /// The best draw, where it is better than the best fit.
    pub(in crate::fit) better: Option<Vec<f64>>,
}

/// Draws that are asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum DrawsAsked {
    /// As many as fits need; uneven weights are followed once.
    Usual,
    /// As many, and uneven weights are followed until they hardly change.
    Steady,
    /// So many, most of which differ.
    Count(usize),
}

impl DrawsAsked {
    /// So many, or with 0 as many as fits need.
    pub fn of(count: usize) -> Self {
        match count {
            0 => Self::Usual,
            count => Self::Count(count),
        }
    }
}

/// Number of draws whose time is that of a fit.
fn usual(problem: &Problem) -> usize {
    (BUDGET.round_samples / problem.samples()).clamp(BUDGET.least_draws, BUDGET.most_draws)
}

/// Draws of θ from the posterior of likelihood and weak priors within the bounds; `fits` are ends of searches, best first.
///
/// Draws of Student densities about the tops are weighed by posterior over their mixture. Unless weights are even already, the weighted mean and
/// covariance about each top propose a second round, as directions that the records hardly know bend; draws are taken from that in proportion
/// to their weights.
///
/// Source: Rubin, "Using the SIR algorithm to simulate posterior distributions" (1988).
pub(crate) fn posterior(
    problem: &Problem,
    fits: &[Fitted],
    asked: DrawsAsked,
    noise: Noise,
) -> Result<PosteriorSample, FilterError> {
    let Some(best) = fits.first() else {
        return Ok(PosteriorSample::default());
    };
    let usual = usual(problem);
    let mut source = noise.source("draws");
    let first: Vec<Proposal> = (tops(problem, fits).into_iter())
        .filter_map(|fit| Proposal::around(problem, fit))
        .collect();
    if first.is_empty() {
        return Ok(PosteriorSample::default());
    }
    let c = &problem.coordinates;
    let log_prior = |phi: &DVector<f64>| problem.log_prior(&c.theta(phi.as_slice()), true);
    let mut proposals = first.clone();
    let mut round = Round::new(problem, &proposals, usual, &mut source, log_prior)?;
    let is_even = round.effective() >= BUDGET.even_weights * usual as f64;
    let count = match asked {
        DrawsAsked::Count(count) => count,
        _ => usual,
    };
    let (rounds, size) = match asked {
        DrawsAsked::Usual | DrawsAsked::Steady if is_even => (0, usual),
        DrawsAsked::Usual => (1, usual),
        _ => (BUDGET.adaptations, usual.max(BUDGET.draws_each * count)),
    };
    let mut better = (best.objective + BUDGET.better_draw, None);
    let mut look = |round: &Round| {
        if let Some((phi, value)) = round.best()
            && value > better.0
        {
            better = (value, Some(c.theta(phi.as_slice())));
        }
    };
    look(&round);
    for left in (0..rounds).rev() {
        proposals = round.adapted(&first, BUDGET.kept_covariance);
        let size = if left == 0 { size } else { usual };
        round = Round::new(problem, &proposals, size, &mut source, log_prior)?;
        look(&round);
    }
    let taken = round.taken(count);
    let theta = |i: &usize| c.theta(round.draws[*i].as_slice());
    Ok(PosteriorSample {
        thetas: taken.iter().map(theta).collect(),
        modes: taken.iter().map(|i| round.modes[*i]).collect(),
        effective: round.effective(),
        proposals: round.adapted(&first, BUDGET.kept_covariance),
        better: better.1,
        round: Some(round),
    })
}

/// Ends of searches that are tops of their own, best first.
fn tops<'a>(problem: &Problem, fits: &'a [Fitted]) -> Vec<&'a Fitted> {
    let mut tops: Vec<&Fitted> = vec![];
    for fit in fits {
        let is_apart = |top: &&Fitted| {
            top.squared_distance(problem, fit) > BUDGET.tops_apart * BUDGET.tops_apart
        };
        if fit.objective > fits[0].objective - BUDGET.counting_top && tops.iter().all(is_apart) {
            tops.push(fit);
        }
    }
    tops
}
