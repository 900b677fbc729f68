//! Other tops, seen along each axis through the best one.
//!
//! Random points hardly meet the narrow top of a frequency or a time while another parameter, which explains more, is wrong, too. Where the others
//! are right, all of an axis can be looked at.

use super::joined;
use crate::fit::budget::BUDGET;
use crate::fit::climb::Fitted;
use crate::fit::problem::Problem;
use crate::likelihood::kalman::FilterError;
use crate::math::descending;

/// Searches from the highest tops along the axes through the best fit, and again from a better one that these find.
pub(super) fn scanned(
    problem: &Problem,
    mut fits: Vec<Fitted>,
    iterations: usize,
) -> Result<Vec<Fitted>, FilterError> {
    for _ in 0..BUDGET.more_starts {
        let Some(best) = fits.first() else { break };
        let before = best.objective;
        let starts = tops(problem, best)?;
        if starts.is_empty() {
            break;
        }
        fits = joined(problem, fits, &starts, iterations)?;
        if fits[0].objective <= before + BUDGET.restart_gain {
            break;
        }
    }
    Ok(fits)
}

/// The highest tops of the log-posterior along the axes through a fit, without its own.
fn tops(problem: &Problem, best: &Fitted) -> Result<Vec<Vec<f64>>, FilterError> {
    let c = &problem.coordinates;
    let phi = c.of(&best.theta);
    let free: Vec<usize> = (0..phi.len())
        .filter(|&j| !problem.axes[j].held && problem.axes[j].begin.is_none())
        .collect();
    let points = BUDGET.scan_samples / problem.samples() / free.len().max(1);
    if points < BUDGET.scan_points.0 || problem.is_simulated() {
        return Ok(vec![]);
    }
    let points = points.min(BUDGET.scan_points.1);
    let priors: Vec<(f64, f64)> = problem.prior_terms().collect();
    let mut found: Vec<(f64, Vec<f64>)> = vec![];
    for j in free {
        let (centre, precision) = priors[j];
        let reach = BUDGET.scan_reach / precision.sqrt();
        let (low, high) = (
            c.lower()[j].max(centre - reach),
            c.upper()[j].min(centre + reach),
        );
        let spacing = (high - low) / points as f64;
        if !spacing.is_finite() || spacing <= 0.0 {
            continue;
        }
        let at = |i: usize| low + (i as f64 + 0.5) * spacing;
        let thetas: Vec<Vec<f64>> = (0..points)
            .map(|i| {
                let mut moved = phi.clone();
                moved[j] = at(i);
                c.theta(&moved)
            })
            .collect();
        let values: Vec<f64> = (problem.log_posteriors(&thetas)?.into_iter())
            .map(|value| value.unwrap_or(f64::NEG_INFINITY))
            .collect();
        for i in 1..points - 1 {
            let is_top = values[i] > values[i - 1] && values[i] >= values[i + 1];
            if is_top && (at(i) - phi[j]).abs() > spacing {
                found.push((values[i], thetas[i].clone()));
            }
        }
    }
    descending(&mut found, |a| a.0);
    found.truncate(BUDGET.screened_starts);
    Ok(found.into_iter().map(|(_, theta)| theta).collect())
}
