//! Standard errors and intervals of a fit.

use super::resampling::{DrawsAsked, PosteriorSample, posterior};
use crate::fit::budget::BUDGET;
use crate::fit::climb::Fitted;
use crate::fit::problem::Problem;
use crate::likelihood::kalman::FilterError;
use crate::math::{deviation, quantile};
use crate::twin::Noise;
use statrs::distribution::{ContinuousCDF, Normal};

/// Standard errors of θ of the first record, and intervals, which hold it.
pub(crate) struct FitIntervals {
    pub errors: Vec<f64>,
    pub low: Vec<f64>,
    pub high: Vec<f64>,
}

impl FitIntervals {
    /// From posterior draws around a fit; of a simulated likelihood, whose draws would cost ensembles, to first order.
    pub fn drawn(
        problem: &Problem,
        fitted: &Fitted,
        level: f64,
        noise: Noise,
    ) -> Result<Self, FilterError> {
        let draws = match problem.is_simulated() {
            true => PosteriorSample::default(),
            false => {
                // With fewer rounds, deviations of a clipped record differ by a seventh from one set of units to another.
                let asked = DrawsAsked::Steady;
                posterior(problem, std::slice::from_ref(fitted), asked, noise)?
            }
        };
        Ok(Self::new(problem, fitted, &draws.thetas, level))
    }

    /// From posterior draws, where enough of them differ; otherwise first order in φ.
    pub fn new(problem: &Problem, fitted: &Fitted, draws: &[Vec<f64>], level: f64) -> Self {
        let d = problem.twin.parameters().len();
        let mut first: Vec<u64> = draws
            .iter()
            .map(|theta| theta.iter().map(|v| v.to_bits()).fold(0, u64::wrapping_add))
            .collect();
        first.sort_unstable();
        first.dedup();
        if first.len() >= BUDGET.interval_draws {
            // Draws of an angle lie within half a turn of it.
            let near = |j: usize, v: f64| match problem.axes[j].period() {
                Some(turn) => v - turn * ((v - fitted.theta[j]) / turn).round(),
                None => v,
            };
            let columns: Vec<Vec<f64>> = (0..d)
                .map(|j| draws.iter().map(|theta| near(j, theta[j])).collect())
                .collect();
            // At a bound, draws may lie on one side of the value alone.
            let ends = |p: f64, outer: fn(f64, f64) -> f64| -> Vec<f64> {
                let end = |(column, value): (&Vec<f64>, &f64)| {
                    quantile(column, p).map_or(f64::NAN, |end| outer(end, *value))
                };
                columns.iter().zip(&fitted.theta).map(end).collect()
            };
            return Self {
                errors: columns.iter().map(|column| deviation(column)).collect(),
                low: ends(0.5 - 0.5 * level, f64::min),
                high: ends(0.5 + 0.5 * level, f64::max),
            };
        }
        let c = &problem.coordinates;
        let phi = c.of(&fitted.theta);
        let slopes = c.slopes(&fitted.theta);
        let errors = fitted.std_errors(problem);
        let reach = Normal::standard().inverse_cdf(0.5 + 0.5 * level);
        let end = |j: usize, sign: f64| {
            let mut moved = phi.clone();
            moved[j] += sign * reach * errors[j] / slopes[j];
            c.theta(&moved)[j]
        };
        Self {
            low: (0..d).map(|j| end(j, -1.0)).collect(),
            high: (0..d).map(|j| end(j, 1.0)).collect(),
            errors,
        }
    }
}
