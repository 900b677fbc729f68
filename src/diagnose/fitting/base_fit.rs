//! The first fit of the twin as it is.

use crate::diagnose::fitting::climb::{Fitted, fit};
use crate::diagnose::fitting::growing;
use crate::diagnose::fitting::problem::Problem;
use crate::diagnose::settings::DiagnoseSettings;
use crate::likelihood::kalman::{FilterError, recoverable};
use crate::twin::Noise;
use rayon::prelude::*;

/// Random points whose likelihood is looked at, and how many become starts.
const SCREENED: u64 = 48;
const SCREENED_STARTS: usize = 3;
/// Iterations of the base fit.
pub(in crate::diagnose) const ITERATIONS: usize = 25;

/// The best θ of all starts: the prior's centre, the estimator's, and the best of random ones.
pub(in crate::diagnose) fn base_fit(
    problem: &Problem<'_>,
    settings: &DiagnoseSettings,
    noise: Noise,
) -> Result<Option<Fitted>, FilterError> {
    if problem.is_simulated() {
        return growing::base_fit(problem, settings, noise);
    }
    let space = problem.twin.parameters();
    let mut screened: Vec<(f64, Vec<f64>)> = (0..SCREENED)
        .into_par_iter()
        .map(|i| {
            let noise = noise.child("starts").sample(i);
            let theta = match i % 2 {
                0 => space.draw_prior(noise),
                _ => space.draw_bounds(noise),
            };
            let theta = problem.clamp(&problem.full(&theta));
            let value = recoverable(problem.log_likelihood(&theta))?;
            Ok(value.map(|v| (v + problem.log_prior(&theta, true), theta)))
        })
        .collect::<Result<Vec<_>, FilterError>>()?
        .into_iter()
        .flatten()
        .collect();
    screened.sort_by(|a, b| b.0.total_cmp(&a.0));
    let starts: Vec<Vec<f64>> = [problem.centre()]
        .into_iter()
        .chain(
            settings
                .initial
                .as_ref()
                .map(|theta| problem.clamp(&problem.full(theta))),
        )
        .chain(
            screened
                .into_iter()
                .take(SCREENED_STARTS)
                .map(|(_, theta)| theta),
        )
        .collect();
    let fits: Vec<Option<Fitted>> = (starts.par_iter())
        .map(|start| fit(problem, std::slice::from_ref(start), ITERATIONS))
        .collect::<Result<_, _>>()?;
    Ok((fits.into_iter().flatten()).reduce(|best, other| {
        if other.objective > best.objective {
            other
        } else {
            best
        }
    }))
}
