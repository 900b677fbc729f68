//! Gradient and information of the likelihood that an ensemble gives, from differences.
//!
//! Innovations and covariances a step beside θ, of the same draws, say how both change; of Gaussian innovations the gradient is
//! then D·r and the information DᵀD, as in `scan.rs`.

use crate::diagnose::problem::{Problem, Slope};
use crate::diagnose::scan::Reference;
use crate::likelihood::kalman::{FilterError, Filtered};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Everything that a step of a fit needs, at θ.
pub(in crate::diagnose) fn slope(
    problem: &Problem<'_>,
    theta: &[f64],
) -> Result<Slope, FilterError> {
    let here = match problem.last_seen(theta) {
        Some(here) => here,
        None => problem.filtered(theta)?,
    };
    let here = Reference::bare(here);
    let d = problem.dimension();
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
    let mut slope = Slope {
        log_likelihood: here.filtered.iter().map(|f| f.log_likelihood).sum(),
        log_prior: problem.log_prior(theta, true),
        gradient: DVector::zeros(d),
        information: DMatrix::zeros(d, d),
    };
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
