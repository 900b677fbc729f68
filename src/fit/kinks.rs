//! Tops at kinks: where dry friction, a threshold or a delay bends the likelihood, a climb stops at the kink, and no slope leads along it.
//!
//! A simplex needs no slope. From the end of a climb whose gradient is not gone, argmin's Nelder–Mead goes on among the entries inside their
//! bounds, in standard deviations of the posterior there, and another climb from its end.
//!
//! Source: Nelder & Mead, "A simplex method for function minimization", *The Computer Journal* 7 (1965).

use super::certificate::Certificate;
use super::climb::{Fitted, climb};
use super::problem::Problem;
use super::solver::evaluation_error;
use crate::fit::budget::{BUDGET, ITERATIONS};
use crate::likelihood::kalman::{FilterError, recoverable};
use argmin::core::{CostFunction, Executor, IterState};
use argmin::solver::neldermead::NelderMead;
use nalgebra::{DMatrix, DVector};

/// Goes on from a fit along the kinks that it ended at; the fit itself where its gradient is gone, and of a simulated likelihood, of which a
/// value costs an ensemble.
pub(super) fn over_kinks(problem: &Problem, fit: Fitted) -> Result<Fitted, FilterError> {
    let mut best = fit;
    for _ in 0..BUDGET.kink_rounds {
        let Some(plane) = Plane::about(problem, &best) else {
            break;
        };
        let next = climb(
            &problem.until(BUDGET.polished_gain),
            &plane.lowest()?,
            ITERATIONS,
        )?;
        let before = best.objective;
        match next.filter(|next| next.objective > before) {
            Some(next) => best = next,
            None => break,
        }
        if best.objective < before + BUDGET.same_top {
            break;
        }
    }
    Ok(best)
}

/// Minus the log-posterior about a fit, in standard deviations of its free entries.
struct Plane<'p> {
    problem: &'p Problem,
    phi: DVector<f64>,
    free: Vec<usize>,
    /// Root of the covariance of the free entries.
    root: DMatrix<f64>,
}

impl<'p> Plane<'p> {
    /// The plane about a fit; `None` where its gradient is gone or nothing is free.
    fn about(problem: &'p Problem, fit: &Fitted) -> Option<Self> {
        let end = Certificate::new(problem, std::slice::from_ref(fit))?;
        if problem.is_simulated() || end.distance <= BUDGET.arrived {
            return None;
        }
        let free: Vec<usize> = (0..end.at_bound.len())
            .filter(|&j| end.at_bound[j].is_none() && !problem.axes[j].held)
            .collect();
        let information = fit.information.select_rows(&free).select_columns(&free);
        let n = free.len();
        let root = information
            .cholesky()?
            .l()
            .tr_solve_lower_triangular(&DMatrix::identity(n, n))?;
        (n > 0).then(|| Self {
            problem,
            phi: DVector::from_vec(problem.coordinates.of(&fit.theta)),
            free,
            root,
        })
    }

    /// Full θ at a point.
    fn theta(&self, z: &DVector<f64>) -> Vec<f64> {
        let mut phi = self.phi.clone();
        for (&j, step) in self.free.iter().zip((&self.root * z).iter()) {
            phi[j] += step;
        }
        let c = &self.problem.coordinates;
        c.theta(c.clamp(&phi).as_slice())
    }

    /// Full θ where the simplex ends.
    fn lowest(&self) -> Result<Vec<f64>, FilterError> {
        let n = self.free.len();
        let corners = (0..=n).map(|i| DVector::from_fn(n, |j, _| f64::from(i == j + 1)));
        let steps = BUDGET.simplex_steps * n as u64;
        let mut state = NelderMead::new(corners.collect())
            .with_sd_tolerance(BUDGET.simplex_end)
            .and_then(|simplex| {
                Executor::new(self, simplex)
                    .configure(|state: IterState<DVector<f64>, (), (), (), (), f64>| {
                        state.max_iters(steps).counting(false)
                    })
                    .ctrlc(false)
                    .run()
            })
            .map_err(evaluation_error::<FilterError>)?
            .state;
        let best = state.take_best_param();
        Ok(self.theta(&best.unwrap_or_else(|| DVector::zeros(n))))
    }
}

impl CostFunction for &Plane<'_> {
    type Param = DVector<f64>;
    type Output = f64;

    fn cost(&self, z: &DVector<f64>) -> Result<f64, argmin::core::Error> {
        let theta = self.theta(z);
        let value = recoverable(self.problem.log_likelihood(&theta))?;
        Ok(value.map_or(f64::INFINITY, |value| {
            -value - self.problem.log_prior(&theta, true)
        }))
    }
}
