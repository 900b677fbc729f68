//! Gradient and information of the likelihood.
//!
//! With equations, the filter's score gives both. Without, differences do: innovations and covariances a step beside θ, of the same
//! draws, give the directions D; for Gaussian innovations the gradient is D·r and the information DᵀD, as in `reference.rs`.

use crate::fit::problem::Problem;
use crate::fit::reference::Reference;
use crate::fit::solver::LocalModel;
use crate::likelihood::kalman::{FilterError, Filtered};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Quadratic model of minus the log-posterior at θ, the weak priors included; `innovations` are those of a black box at θ, where they are known.
pub(super) fn model(
    problem: &Problem,
    theta: &[f64],
    innovations: Option<Vec<Filtered>>,
) -> Result<LocalModel, FilterError> {
    let d = problem.dimension();
    let mut model = LocalModel {
        cost: 0.0,
        gradient: DVector::zeros(d),
        information: DMatrix::zeros(d, d),
    };
    if problem.is_simulated() {
        let innovations = innovations.map_or_else(|| problem.filtered(theta), Ok)?;
        add_differences(problem, theta, innovations, &mut model)?;
    } else {
        add_scores(problem, theta, &mut model)?;
    }
    model.cost -= problem.log_prior(theta, true);
    let phi = problem.coordinates.of(theta);
    for (j, (centre, precision)) in problem.prior_terms().enumerate() {
        model.gradient[j] += precision * (phi[j] - centre);
        model.information[(j, j)] += precision;
    }
    Ok(model)
}

/// Adds the filter's score of each record.
fn add_scores(problem: &Problem, theta: &[f64], model: &mut LocalModel) -> Result<(), FilterError> {
    for (r, place) in problem.places.iter().enumerate() {
        let Some(score) = problem.score(r, theta)? else {
            continue;
        };
        model.cost -= score.log_likelihood;
        for (a, &i) in place.iter().enumerate() {
            model.gradient[i] -= score.gradient[a];
            for (b, &j) in place.iter().enumerate() {
                model.information[(i, j)] += score.fisher[(a, b)];
            }
        }
    }
    Ok(())
}

/// Adds an ensemble's likelihood at θ with these innovations, derivatives from differences.
fn add_differences(
    problem: &Problem,
    theta: &[f64],
    innovations: Vec<Filtered>,
    model: &mut LocalModel,
) -> Result<(), FilterError> {
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
    model.cost -= here.filtered.iter().map(|f| f.log_likelihood).sum::<f64>();
    for (i, a) in directions.iter().enumerate() {
        let Some(a) = a else { continue };
        model.gradient[i] = -here.residual().dot(a);
        for (j, b) in directions.iter().enumerate().take(i + 1) {
            let Some(b) = b else { continue };
            model.information[(i, j)] = a.dot(b);
            model.information[(j, i)] = model.information[(i, j)];
        }
    }
    Ok(())
}
