//! The end of a fit: has it arrived?

use super::climb::Fitted;
use super::problem::Problem;
use super::starts::{agreeing, climbs, polish, sort};
use crate::fit::budget::{BUDGET, ITERATIONS};
use crate::likelihood::kalman::FilterError;
use crate::twin::{Noise, Side};

/// End of a fit.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Certificate {
    /// √(gᵀF⁻¹g) of the entries that may move: distance to the top of the quadratic, in standard deviations.
    pub distance: f64,
    /// The bound that each entry lies at, if any.
    pub at_bound: Vec<Option<Side>>,
    /// Searches that found the best top, and all that ended anywhere.
    pub agreeing: usize,
    pub searches: usize,
}

impl Certificate {
    /// Certifies the best of several fits, best first.
    pub fn new(problem: &Problem, fits: &[Fitted]) -> Option<Self> {
        let best = fits.first()?;
        let c = &problem.coordinates;
        let phi = c.of(&best.theta);
        let at_bound: Vec<Option<Side>> = (0..phi.len())
            .map(|j| {
                let slack = 1e-6 * (c.upper()[j] - c.lower()[j]).abs().min(1.0);
                if problem.axes[j].held {
                    None
                } else if phi[j] <= c.lower()[j] + slack {
                    Some(Side::Low)
                } else if phi[j] >= c.upper()[j] - slack {
                    Some(Side::High)
                } else {
                    None
                }
            })
            .collect();
        let free: Vec<usize> = (0..phi.len())
            .filter(|&j| at_bound[j].is_none() && !problem.axes[j].held)
            .collect();
        let matrix = best.information.select_rows(&free).select_columns(&free);
        let gradient = best.gradient.select_rows(&free);
        let distance = (matrix.cholesky()).map_or(f64::INFINITY, |f| {
            gradient.dot(&f.solve(&gradient)).max(0.0).sqrt()
        });
        Some(Self {
            distance,
            at_bound,
            agreeing: agreeing(fits),
            searches: fits.len(),
        })
    }

    /// `true` where the gradient is gone and more than one search ended there, or the only one.
    pub fn has_converged(&self) -> bool {
        // Three that began apart need no majority: some starts are there to find other tops.
        let enough = self.agreeing > 2 || 2 * self.agreeing > self.searches && self.agreeing > 1;
        self.distance <= BUDGET.arrived && (self.agreeing > 1 || self.searches == 1)
            || self.distance <= BUDGET.agreed && enough
    }
}

/// Searches from points drawn over the prior, not chosen near any top, until a round of them finds nothing better; `false` where the last
/// round still does. Ends join `fits`. Of a simulated likelihood, whose searches cost ensembles, nothing is asked.
pub(super) fn restarted(
    problem: &Problem,
    fits: &mut Vec<Fitted>,
    noise: Noise,
) -> Result<bool, FilterError> {
    if problem.is_simulated() || fits.is_empty() {
        return Ok(true);
    }
    let space = problem.twin.parameters();
    for round in 0..BUDGET.restart_rounds {
        let starts: Vec<Vec<f64>> = (0..BUDGET.restarts)
            .map(|i| {
                let noise = noise.sample(round * BUDGET.restarts + i);
                let theta = problem.full(&space.draw_prior(noise));
                problem.begin(&problem.drawn(theta, noise))
            })
            .collect();
        let best = fits[0].objective;
        fits.extend(climbs(problem, &starts, ITERATIONS)?);
        sort(fits);
        if fits[0].objective <= best + BUDGET.restart_gain {
            return Ok(true);
        }
        *fits = polish(problem, fits.clone(), ITERATIONS)?;
    }
    Ok(false)
}

#[cfg(test)]
mod tests {
    use crate::record::{Drive, Record, Signal};
    use crate::study::Study;
    use crate::twin::fixture::OneState;
    use crate::twin::{Integrator, Parameter, Twin};

    /// The level of noise ends where no filter tells a smaller one: at a bound, not on a slope.
    #[test]
    fn searches_arrive_at_records_without_noise() {
        let truth = [2.0, 3.0];
        for declared in [1e-2, 1e-4, 1e-7] {
            let gain = Parameter::new("K", "K/W", 0.5, 4.0);
            let tau = Parameter::new("tau", "s", 1.0, 8.0);
            let room = OneState {
                noise: [0.0, declared],
                start: Some(0.0),
                integrator: Integrator::RungeKutta4,
                ..OneState::new([gain, tau], |theta, u, x| (theta[0] * u[0] - x) / theta[1])
            };
            let inputs = Signal::from_shape_fn((100, 1), |(k, _)| (k / 9 % 3) as f64);
            let drive = Drive::new(0.5, inputs).unwrap();
            let run = Twin::new(room.clone()).free_run(&truth, &drive).unwrap();
            let record = Record::new(drive, run).unwrap();
            let fit = Study::of(room).unwrap().fit(&[record]).unwrap();
            assert!(fit.convergence.converged, "{:?}", fit.convergence);
            for (parameter, truth) in fit.parameters.iter().zip(truth) {
                assert!((parameter.value - truth).abs() < 1e-5, "{parameter:?}");
            }
        }
    }
}
