//! Errors of the pretrained network near a prediction.

use crate::math::quantile;
use ndarray::Array2;
use statrs::distribution::{ContinuousCDF, Normal};

/// Level of the intervals given with an estimate.
pub const INTERVAL_LEVEL: f64 = 0.9;
/// Neighbours of a prediction whose errors are taken as its own.
const NEIGHBOURS: usize = 100;

/// Predictions on simulations that the network was not trained on, beside the truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// Predicted parameters, one simulation a row.
    pub predicted: Array2<f64>,
    /// The parameters simulated.
    pub truth: Array2<f64>,
}

/// Errors to expect of a prediction, parameter by parameter, in parameter units.
#[derive(Debug, Clone, PartialEq)]
pub struct Spread {
    /// Root mean square error.
    pub std_error: Vec<f64>,
    /// Offset of the lower end from the prediction.
    pub low: Vec<f64>,
    /// Offset of the upper end.
    pub high: Vec<f64>,
}

impl Spread {
    /// Creates the intervals of normal errors with these standard deviations.
    pub fn normal(std_error: Vec<f64>, level: f64) -> Self {
        let reach = Normal::standard().inverse_cdf(0.5 + 0.5 * level);
        let ends = |sign: f64| std_error.iter().map(|s| sign * reach * s).collect();
        Self {
            low: ends(-1.0),
            high: ends(1.0),
            std_error,
        }
    }
}

/// The probability at which the quantile of `count` errors is exceeded by a new error as often as `tail` says: the new one
/// is one of count + 1 alike, and the order statistic needed is number tail·(count + 1).
///
/// Source: Vovk, Gammerman & Shafer, *Algorithmic Learning in a Random World* (2005), chapter 2.
fn tail(count: usize, tail: f64) -> f64 {
    let (count, rank) = (count as f64, tail * (count as f64 + 1.0));
    ((rank - 1.0) / (count - 1.0).max(1.0)).max(0.0)
}

impl Calibration {
    /// True parameters of the simulations whose predictions lie nearest to `prediction`, distances in `widths`.
    pub(crate) fn truths_near(&self, prediction: &[f64], widths: &[f64]) -> Vec<Vec<f64>> {
        (self.nearest(prediction, widths).into_iter())
            .map(|i| self.truth.row(i).to_vec())
            .collect()
    }

    /// Numbers of the simulations whose predictions lie nearest.
    fn nearest(&self, prediction: &[f64], widths: &[f64]) -> Vec<usize> {
        let distance = |i: usize| -> f64 {
            (self.predicted.row(i).iter().zip(prediction).zip(widths))
                .map(|((p, q), w)| ((p - q) / w).powi(2))
                .sum()
        };
        let mut nearest: Vec<(f64, usize)> = (0..self.predicted.nrows())
            .map(|i| (distance(i), i))
            .collect();
        nearest.sort_by(|a, b| a.0.total_cmp(&b.0));
        nearest.truncate(NEIGHBOURS);
        nearest.into_iter().map(|(_, i)| i).collect()
    }

    /// Errors of the simulations whose predictions lie nearest to `prediction`, distances in `widths`; ends are the
    /// quantiles (1 ± level)/2. `None` without simulations.
    pub fn spread(&self, prediction: &[f64], widths: &[f64], level: f64) -> Option<Spread> {
        let nearest = self.nearest(prediction, widths);
        let errors = |j: usize| -> Vec<f64> {
            (nearest.iter())
                .map(|&i| self.truth[[i, j]] - self.predicted[[i, j]])
                .collect()
        };
        let mut spread = Spread {
            std_error: vec![],
            low: vec![],
            high: vec![],
        };
        for j in 0..prediction.len() {
            let errors = errors(j);
            let square = errors.iter().map(|e| e * e).sum::<f64>() / errors.len().max(1) as f64;
            spread.std_error.push(square.sqrt());
            let tail = tail(errors.len(), 0.5 - 0.5 * level);
            spread.low.push(quantile(&errors, tail).ok()?);
            spread.high.push(quantile(&errors, 1.0 - tail).ok()?);
        }
        Some(spread)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Noise;

    /// Errors grow with θ; the interval at a prediction follows, and covers nine in ten new errors.
    #[test]
    fn intervals_follow_the_local_error() {
        let draw = |i: u64, purpose| {
            let mut source = Noise::new(1, purpose, i).source("x");
            let theta = source.uniform();
            (theta, theta - 0.1 * theta * source.normal())
        };
        let pairs: Vec<_> = (0..2000).map(|i| draw(i, "calibration")).collect();
        let column = |of: fn(&(f64, f64)) -> f64| {
            Array2::from_shape_vec((2000, 1), pairs.iter().map(of).collect()).unwrap()
        };
        let calibration = Calibration {
            predicted: column(|p| p.1),
            truth: column(|p| p.0),
        };
        let trials = 1000;
        let covered = (0..trials).filter(|&i| {
            let (theta, predicted) = draw(i, "trial");
            let spread = calibration.spread(&[predicted], &[1.0], 0.9).unwrap();
            let ends = predicted + spread.low[0]..=predicted + spread.high[0];
            ends.contains(&theta)
        });
        let bounds = crate::math::binomial_bounds(trials, 0.9, 0.999).unwrap();
        let covered = covered.count() as u64;
        // A hundred neighbours blur the ends a little: allow one percent more.
        assert!(
            covered + 10 >= *bounds.start() && covered <= *bounds.end() + 10,
            "{covered}"
        );
    }
}
