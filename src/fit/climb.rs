//! The most probable θ of a twin, given its records and a weak prior.

use crate::fit::problem::Problem;
use crate::fit::slope::{Slope, slope as slope_at};
use crate::likelihood::kalman::{FilterError, recoverable};
use nalgebra::{DMatrix, DVector};

/// Steps may be so many times the longest of an entry where entries answer each other.
const LONGER: f64 = 2.0;

/// Result of a fit.
#[derive(Debug, Clone)]
pub(crate) struct Fitted {
    /// Full θ.
    pub theta: Vec<f64>,
    pub log_likelihood: f64,
    /// Objective of the fit: likelihood and all priors.
    pub objective: f64,
    /// Gradient of the objective in φ.
    pub gradient: DVector<f64>,
    /// Information in φ, that of the priors included.
    pub information: DMatrix<f64>,
}

impl Fitted {
    /// Standard deviations of θ from information and prior, first order.
    pub fn std_errors(&self, problem: &Problem) -> Vec<f64> {
        let slopes = problem.coordinates.slopes(&self.theta);
        match self.information.clone().try_inverse() {
            Some(covariance) => (slopes.iter().enumerate())
                .map(|(j, slope)| slope * covariance[(j, j)].max(0.0).sqrt())
                .collect(),
            None => vec![f64::NAN; slopes.len()],
        }
    }
}

/// Damped Fisher scoring from one start, within the bounds; `None` where the filter does not work at the start.
///
/// ```text
/// (F + λ·diag F)·δ = s,   φ ← φ + δ,   λ smaller after a step that helps, larger after one that does not
/// ```
///
/// F holds the information of the weak prior too. Entries at a bound that want to leave it are held for the step. A trial
/// point where the filter fails only rejects the step.
pub(crate) fn climb(
    problem: &Problem,
    start: &[f64],
    iterations: usize,
) -> Result<Option<Fitted>, FilterError> {
    let c = &problem.coordinates;
    let mut phi = c.clamp(&DVector::from_vec(c.of(&problem.clamp(start))));
    let first = recoverable(slope_at(problem, &c.theta(phi.as_slice()), None))?;
    let Some(mut slope) = first.filter(|s| s.objective().is_finite()) else {
        return Ok(None);
    };
    let mut damping: f64 = 0.1;
    let mut tried = 0;
    while tried < iterations && damping < 1e5 {
        tried += 1;
        let Some(step) = step(problem, &slope, &phi, damping) else {
            break;
        };
        let next = c.clamp(&(&phi + &step));
        let moved = (&next - &phi).amax();
        // Not worth a look: the gain that the step promises is nothing.
        if moved < 1e-9 || slope.gradient.dot(&step) < 0.2 * problem.done() {
            break;
        }
        // The likelihood alone tells whether to go there; the derivatives follow if so.
        let theta = c.theta(next.as_slice());
        let trial = recoverable(problem.evaluate(&theta))?.map(|trial| {
            let objective = trial.log_likelihood + problem.log_prior(&theta, true);
            (objective, trial.innovations)
        });
        match trial {
            Some((objective, innovations)) if objective > slope.objective() => {
                let gain = objective - slope.objective();
                let Some(better) = recoverable(slope_at(problem, &theta, innovations))? else {
                    break;
                };
                (phi, slope) = (next, better);
                damping = (0.1 * damping).max(1e-6);
                if gain < problem.done() {
                    break;
                }
            }
            _ => damping = (8.0 * damping).max(1e-3),
        }
    }
    let theta = c.theta(phi.as_slice());
    Ok(Some(Fitted {
        log_likelihood: slope.log_likelihood,
        objective: slope.objective(),
        gradient: slope.gradient,
        information: slope.information,
        theta,
    }))
}

/// Returns what moves a start to where all other entries have answered those of a shape, which stay: a threshold, a lag or a time would go
/// anywhere from afar. With no such entry a start stays where it is.
pub(crate) fn settling(
    problem: &Problem,
    is_shape: &dyn Fn(usize) -> bool,
    iterations: usize,
) -> impl Fn(Vec<f64>) -> Result<Vec<f64>, FilterError> + use<> {
    let has_shape = (0..problem.axes.len()).any(is_shape);
    let held = has_shape.then(|| problem.holding(is_shape));
    move |start| match &held {
        Some(held) => Ok(climb(held, &start, iterations)?.map_or(start, |settled| settled.theta)),
        None => Ok(start),
    }
}

/// The damped step, entries held at their bounds left out.
fn step(
    problem: &Problem,
    slope: &Slope,
    phi: &DVector<f64>,
    damping: f64,
) -> Option<DVector<f64>> {
    let c = &problem.coordinates;
    let free: Vec<usize> = (0..phi.len())
        .filter(|&j| {
            let out_below = phi[j] <= c.lower()[j] && slope.gradient[j] < 0.0;
            let out_above = phi[j] >= c.upper()[j] && slope.gradient[j] > 0.0;
            !(out_below || out_above || problem.axes[j].held)
        })
        .collect();
    let n = free.len();
    if n == 0 {
        return None;
    }
    // An entry's curvature is at least what its longest step needs: far from the top the information is often too small, and one
    // entry's long step must not shorten those of the others.
    let matrix = DMatrix::from_fn(n, n, |a, b| {
        let value = slope.information[(free[a], free[b])];
        if a == b {
            let least = slope.gradient[free[a]].abs() / problem.axes[free[a]].longest;
            value.max(least) * (1.0 + damping) + f64::MIN_POSITIVE
        } else {
            value
        }
    });
    let gradient = DVector::from_fn(n, |a, _| slope.gradient[free[a]]);
    let part = matrix.cholesky()?.solve(&gradient);
    let mut step = DVector::zeros(phi.len());
    let mut shrink: f64 = 1.0;
    for (a, &j) in free.iter().enumerate() {
        step[j] = part[a];
        shrink = shrink.min(LONGER * problem.axes[j].longest / part[a].abs().max(1e-300));
    }
    step.iter().all(|v| v.is_finite()).then(|| step * shrink)
}

/// The best of several starts.
pub(crate) fn fit(
    problem: &Problem,
    starts: &[Vec<f64>],
    iterations: usize,
) -> Result<Option<Fitted>, FilterError> {
    let mut best: Option<Fitted> = None;
    for start in starts {
        if let Some(fitted) = climb(problem, start, iterations)?
            && best.as_ref().is_none_or(|b| fitted.objective > b.objective)
        {
            best = Some(fitted);
        }
    }
    Ok(best)
}
