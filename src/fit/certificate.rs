//! The end of a fit: has it arrived?

use super::climb::Fitted;
use super::problem::Problem;
use super::starts::agreeing;

/// Distance from the top that counts as arrived, in standard deviations: what is left to gain is its square's half, 0.02 nats.
const ARRIVED: f64 = 0.2;
/// The same where three searches, or most of them, end at one top: dry friction and thresholds make kinks, and at a kink no gradient vanishes.
const AGREED: f64 = 1.0;

/// Side of a bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Side {
    /// Lower bound.
    Low,
    /// Upper bound.
    High,
}

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

    /// `true` where the gradient is gone and more than one search ended there.
    pub fn has_converged(&self) -> bool {
        // Three that began apart need no majority: some starts are there to find other tops.
        let enough = self.agreeing > 2 || 2 * self.agreeing > self.searches && self.agreeing > 1;
        self.distance <= ARRIVED && (self.agreeing > 1 || self.searches == 1)
            || self.distance <= AGREED && enough
    }
}
