//! The searches of a fit, and where they ended.

use super::budget::ITERATIONS;
use super::climb::Fitted;
use super::kinks::over_kinks;
use super::problem::Problem;
use super::starts::growing::base_fit;
use super::starts::{polish, thorough};
use crate::effect::Magnitude;
use crate::likelihood::kalman::FilterError;
use crate::twin::Noise;
use std::collections::BTreeMap;

/// Ends of all searches.
#[derive(Clone)]
pub(crate) struct Searched {
    pub problem: Problem,
    /// Best first.
    pub fits: Vec<Fitted>,
    /// The twin without its effects; none where no effects are fitted.
    pub without: Option<WithoutEffects>,
}

/// A twin whose fitted effects are off.
#[derive(Clone)]
pub(crate) struct WithoutEffects {
    /// All magnitudes of its effects are held.
    pub problem: Problem,
    pub fitted: Fitted,
    /// The fitted magnitudes, by name.
    pub magnitudes: BTreeMap<String, Magnitude>,
}

impl Searched {
    /// Fits a twin from the prior's centre and from random points.
    pub fn alone(problem: Problem, noise: Noise) -> Result<Self, FilterError> {
        Ok(Self {
            fits: fits(&problem, &[], noise)?,
            problem,
            without: None,
        })
    }
}

/// Fits from `initial`, from the prior's centre, from where the twin swings as the records do and from random points, best first.
pub(crate) fn fits(
    problem: &Problem,
    initial: &[Vec<f64>],
    noise: Noise,
) -> Result<Vec<Fitted>, FilterError> {
    if !problem.is_simulated() {
        let mut fits = thorough(problem, initial, noise)?;
        if let Some(best) = fits.first_mut() {
            *best = over_kinks(problem, best.clone())?;
        }
        return Ok(fits);
    }
    let theta = initial.first().map(Vec::as_slice);
    let fit = base_fit(problem, theta, noise)?;
    polish(problem, fit.into_iter().collect(), ITERATIONS)
}
