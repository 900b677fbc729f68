//! The first fit of the twin as it is.

use crate::fit::climb::{Fitted, climb};
use crate::fit::growing;
use crate::fit::problem::Problem;
use crate::likelihood::kalman::{FilterError, recoverable};
use crate::twin::Noise;
use rayon::prelude::*;

/// Random points whose likelihood is looked at, and how many become starts.
const SCREENED: u64 = 48;
const SCREENED_STARTS: usize = 3;
/// Nats to the best within which a fit is carried on, and the gain at which it ends.
const NEAR: f64 = 3.0;
const POLISHED: f64 = 1e-4;
/// Iterations of the base fit.
pub(crate) const ITERATIONS: usize = 25;

/// The best fit of all starts; `None` where the twin works at none.
pub(crate) fn base_fit(
    problem: &Problem<'_>,
    initial: Option<&[f64]>,
    noise: Noise,
) -> Result<Option<Fitted>, FilterError> {
    if problem.is_simulated() {
        return growing::base_fit(problem, initial, noise);
    }
    let initial: Vec<Vec<f64>> = initial
        .map(|theta| problem.full(theta))
        .into_iter()
        .collect();
    Ok(search(problem, &initial, noise, ITERATIONS)?
        .into_iter()
        .next())
}

/// Fits from the prior's centre, the full θ that are given, and the best of random ones: best first.
pub(crate) fn search(
    problem: &Problem<'_>,
    initial: &[Vec<f64>],
    noise: Noise,
    iterations: usize,
) -> Result<Vec<Fitted>, FilterError> {
    let space = problem.twin.parameters();
    let mut screened: Vec<(f64, Vec<f64>)> = (0..SCREENED)
        .into_par_iter()
        .map(|i| {
            let noise = noise.child("starts").sample(i);
            let theta = problem.full(&match i % 2 {
                0 => space.draw_prior(noise),
                _ => space.draw_bounds(noise),
            });
            let theta = problem.begin(&problem.drawn(theta, noise));
            let value = recoverable(problem.log_likelihood(&theta))?;
            Ok(value.map(|v| (v + problem.log_prior(&theta, true), theta)))
        })
        .collect::<Result<Vec<_>, FilterError>>()?
        .into_iter()
        .flatten()
        .collect();
    screened.sort_by(|a, b| b.0.total_cmp(&a.0));
    let best = screened.into_iter().take(SCREENED_STARTS);
    let starts: Vec<Vec<f64>> = [problem.begin(&problem.centre())]
        .into_iter()
        .chain(initial.iter().map(|theta| problem.clamp(theta)))
        .chain(best.map(|(_, theta)| theta))
        .collect();
    let fits: Vec<Option<Fitted>> = (starts.par_iter())
        .map(|start| climb(problem, start, iterations))
        .collect::<Result<_, _>>()?;
    let mut fits: Vec<Fitted> = fits.into_iter().flatten().collect();
    sort(&mut fits);
    Ok(fits)
}

/// Carries fits on that are near the best, until they gain hardly anything more.
pub(crate) fn polish(
    problem: &Problem<'_>,
    fits: Vec<Fitted>,
    iterations: usize,
) -> Result<Vec<Fitted>, FilterError> {
    let precise = problem.until(POLISHED);
    let best = fits.first().map_or(f64::NAN, |fit| fit.objective);
    let mut fits: Vec<Fitted> = (fits.into_par_iter())
        .map(|fit| {
            if best - fit.objective > NEAR {
                return Ok(fit);
            }
            Ok(climb(&precise, &fit.theta, iterations)?.unwrap_or(fit))
        })
        .collect::<Result<_, FilterError>>()?;
    sort(&mut fits);
    Ok(fits)
}

/// Best first; of equal ones the first start's stays first.
pub(super) fn sort(fits: &mut [Fitted]) {
    fits.sort_by(|a, b| b.objective.total_cmp(&a.objective));
}
