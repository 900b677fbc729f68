//! Gradient and information of the likelihood.
//!
//! With equations, the filter's score gives both. Without, differences do: innovations and covariances a step beside θ, of the same
//! draws, give the directions D; for Gaussian innovations the gradient is D·r and the information DᵀD, as in `reference.rs`.

use crate::fit::problem::Problem;
use crate::fit::reference::Reference;
use crate::likelihood::kalman::{FilterError, Filtered};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Gradient and information of all records and the weak prior, in φ.
pub(super) struct Slope {
    pub log_likelihood: f64,
    /// Log-density of the weak priors, all of them, up to a constant.
    pub log_prior: f64,
    pub gradient: DVector<f64>,
    pub information: DMatrix<f64>,
}

impl Slope {
    /// Slope of the weak prior's density alone, its gradient yet to be added.
    fn zero(problem: &Problem, theta: &[f64]) -> Self {
        let d = problem.dimension();
        Self {
            log_likelihood: 0.0,
            log_prior: problem.log_prior(theta, true),
            gradient: DVector::zeros(d),
            information: DMatrix::zeros(d, d),
        }
    }

    pub fn objective(&self) -> f64 {
        self.log_likelihood + self.log_prior
    }
}

/// Returns gradient and information at θ; `innovations` are those of a black box at θ, where they are known.
pub(super) fn slope(
    problem: &Problem,
    theta: &[f64],
    innovations: Option<Vec<Filtered>>,
) -> Result<Slope, FilterError> {
    let mut slope = if problem.is_simulated() {
        let innovations = innovations.map_or_else(|| problem.filtered(theta), Ok)?;
        by_differences(problem, theta, innovations)?
    } else {
        by_scores(problem, theta)?
    };
    add_priors(problem, theta, &mut slope);
    Ok(slope)
}

/// Gradient and information from the filter's score of each record.
fn by_scores(problem: &Problem, theta: &[f64]) -> Result<Slope, FilterError> {
    let mut slope = Slope::zero(problem, theta);
    for (r, place) in problem.places.iter().enumerate() {
        let Some(score) = problem.score(r, theta)? else {
            continue;
        };
        slope.log_likelihood += score.log_likelihood;
        for (a, &i) in place.iter().enumerate() {
            slope.gradient[i] += score.gradient[a];
            for (b, &j) in place.iter().enumerate() {
                slope.information[(i, j)] += score.fisher[(a, b)];
            }
        }
    }
    Ok(slope)
}

fn add_priors(problem: &Problem, theta: &[f64], slope: &mut Slope) {
    let phi = problem.coordinates.of(theta);
    for (j, (centre, precision)) in problem.prior_terms().enumerate() {
        slope.gradient[j] -= precision * (phi[j] - centre);
        slope.information[(j, j)] += precision;
    }
}

/// Gradient and information of an ensemble's likelihood at θ with these innovations, from differences.
fn by_differences(
    problem: &Problem,
    theta: &[f64],
    innovations: Vec<Filtered>,
) -> Result<Slope, FilterError> {
    let here = Reference::bare(innovations);
    let directions: Vec<Option<DVector<f64>>> = (problem.neighbours(theta).into_par_iter())
        .enumerate()
        .map(|(j, (moved, distance))| {
            if problem.axes[j].held {
                return Ok(None);
            }
            let there: Vec<Filtered> = problem.filtered(&moved)?;
            Ok(Some(here.direction(&there) / distance))
        })
        .collect::<Result<_, FilterError>>()?;
    let mut slope = Slope::zero(problem, theta);
    slope.log_likelihood = here.filtered.iter().map(|f| f.log_likelihood).sum();
    for (i, a) in directions.iter().enumerate() {
        let Some(a) = a else { continue };
        slope.gradient[i] = here.residual().dot(a);
        for (j, b) in directions.iter().enumerate().take(i + 1) {
            let Some(b) = b else { continue };
            slope.information[(i, j)] = a.dot(b);
            slope.information[(j, i)] = slope.information[(i, j)];
        }
    }
    Ok(slope)
}
