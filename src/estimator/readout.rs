//! From features to parameters: the network, and what stands around it.

use crate::estimator::budget::BUDGET;
use crate::math::{
    MathError, Whitening, ascending, nearest, norm, quantile, to_array, to_matrix, unit,
};
use crate::network::{Network, NetworkError};
use crate::twin::ParameterSpace;
use ndarray::{Array1, Array2, Axis, aview1, concatenate};
use statrs::distribution::{ContinuousCDF, Normal};
use std::sync::Arc;

/// Level of the intervals given with an estimate.
pub const INTERVAL_LEVEL: f64 = 0.9;

/// Features → θ: standardised inputs z, a network, standardised targets, and, unless the settings say otherwise, a quadratic
/// layer beside the network's heads.
///
/// ```text
/// y = q(z) + α·r·network(z)         r: deviation of what q misses;  without a layer  y = network(z)
/// ```
#[derive(Debug, Clone)]
pub struct Readout {
    /// Features → network inputs.
    pub inputs: Standardiser,
    /// Targets ↔ θ.
    pub targets: Scaler,
    pub layer: Option<QuadraticLayer>,
    pub network: Arc<dyn Network>,
}

impl Readout {
    /// θ (rows: samples) from features, bounds not applied.
    pub fn predict(&self, features: &Array2<f64>) -> Result<Array2<f64>, NetworkError> {
        let z = self.inputs.apply(features);
        let said = self.network.predict(&z)?;
        let estimates = match &self.layer {
            Some(layer) => layer.join(&z, &said),
            None => said,
        };
        Ok(self.targets.invert(&estimates))
    }
}

/// z = (x − mean)/scale for each column; a column that never changes has scale 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Scaler {
    /// Means.
    pub mean: Vec<f64>,
    /// Standard deviations.
    pub scale: Vec<f64>,
}

impl Scaler {
    /// From rows of samples.
    pub fn fit(samples: &Array2<f64>) -> Self {
        let columns = samples.columns().into_iter().map(|column| {
            let size = column.fold(0.0, |a: f64, v| a.max(v.abs()));
            let unit = unit(size);
            let column = column.mapv(|v| v / unit);
            let deviation = column.std(0.0) * unit;
            // Rounding of the mean must not be blown up to unit size.
            let varies = deviation > 1e-12 * size;
            let scale = if varies { deviation } else { 1.0 };
            (column.mean().unwrap_or(0.0) * unit, scale)
        });
        let (mean, scale) = columns.unzip();
        Self { mean, scale }
    }

    /// z.
    pub fn apply(&self, samples: &Array2<f64>) -> Array2<f64> {
        (samples - &aview1(&self.mean)) / aview1(&self.scale)
    }

    /// x from z.
    pub fn invert(&self, z: &Array2<f64>) -> Array2<f64> {
        z * &aview1(&self.scale) + aview1(&self.mean)
    }
}

/// Network inputs z = clip((x − mean)·W, ±limit), as many as features.
///
/// Two forms: each feature by itself ([`each`](Self::each)), or along the principal axes of the correlation matrix
/// ([`principal`](Self::principal)). Features such as AR coefficients are 0.99 correlated and the information sits in their differences,
/// which principal axes show at unit size; axes along which nothing varies are zero.
#[derive(Debug, Clone, PartialEq)]
pub struct Standardiser {
    /// Means of the features (n).
    pub mean: Vec<f64>,
    /// W (n × n).
    pub matrix: Array2<f64>,
    /// Largest |z|; infinite for none.
    pub limit: f64,
}

impl Standardiser {
    /// Zero mean and unit deviation feature by feature; no limit.
    pub fn each(samples: &Array2<f64>) -> Self {
        let Scaler { mean, scale } = Scaler::fit(samples);
        let diagonal: Array1<f64> = scale.iter().map(|s| 1.0 / s).collect();
        Self {
            mean,
            matrix: Array2::from_diag(&diagonal),
            limit: f64::INFINITY,
        }
    }

    /// Zero mean and unit covariance, largest |z| `limit`.
    pub fn principal(samples: &Array2<f64>, limit: f64) -> Result<Self, MathError> {
        let whitening = Whitening::calibrated(samples)?;
        let (mean, axes) = (whitening.mean(), whitening.matrix());
        let n = mean.len();
        Ok(Self {
            mean: mean.as_slice().to_vec(),
            matrix: to_array(&axes.transpose().resize_horizontally(n, 0.0)),
            limit,
        })
    }

    /// z of features (rows: samples).
    pub fn apply(&self, features: &Array2<f64>) -> Array2<f64> {
        let mut z = (features - &aview1(&self.mean)).dot(&self.matrix);
        z.mapv_inplace(|v| nearest(v, -self.limit, self.limit));
        z
    }
}

/// ŷ = B·[1, z, s⊗s], where s = A·[1, z] is the best linear estimate of the targets; n features, d targets.
///
/// Squares and products are those of the d linear estimates, not of all features: a curved map needs d(d + 1)/2 more
/// terms, whatever n is. Both fits are ridge regressions, the constant left free.
///
/// Source: Beaumont, Zhang & Balding, "Approximate Bayesian computation in population genetics", *Genetics* 162 (2002), for
/// regression on a cloud of simulations.
#[derive(Debug, Clone, PartialEq)]
pub struct Quadratic {
    /// A, (1 + n) × d.
    linear: Array2<f64>,
    /// B, (1 + n + d(d + 1)/2) × d.
    full: Array2<f64>,
}

impl Quadratic {
    /// Fits inputs (M × n) of about unit size to targets (M × d); `ridge` > 0 counts like as many rows of unit inputs.
    /// `None` where numbers are not finite.
    pub fn fit(inputs: &Array2<f64>, targets: &Array2<f64>, ridge: f64) -> Option<Self> {
        let terms = with_constant(inputs);
        let linear = regress(&terms, targets, ridge)?;
        let terms = with_products(&terms, &terms.dot(&linear));
        let full = regress(&terms, targets, ridge)?;
        Some(Self { linear, full })
    }

    /// ŷ of inputs (rows: samples).
    pub fn predict(&self, inputs: &Array2<f64>) -> Array2<f64> {
        let terms = with_constant(inputs);
        with_products(&terms, &terms.dot(&self.linear)).dot(&self.full)
    }
}

fn with_constant(inputs: &Array2<f64>) -> Array2<f64> {
    let ones = Array2::ones((inputs.nrows(), 1));
    concatenate(Axis(1), &[ones.view(), inputs.view()]).expect("as many rows")
}

fn with_products(terms: &Array2<f64>, estimates: &Array2<f64>) -> Array2<f64> {
    let d = estimates.ncols();
    let pairs: Vec<(usize, usize)> = (0..d).flat_map(|i| (i..d).map(move |j| (i, j))).collect();
    let products = Array2::from_shape_fn((estimates.nrows(), pairs.len()), |(row, k)| {
        estimates[[row, pairs[k].0]] * estimates[[row, pairs[k].1]]
    });
    concatenate(Axis(1), &[terms.view(), products.view()]).expect("as many rows")
}

/// (XᵀX + λ·I)⁻¹XᵀY; the first column of X, the constant, has no λ.
fn regress(terms: &Array2<f64>, targets: &Array2<f64>, ridge: f64) -> Option<Array2<f64>> {
    let transposed = terms.t();
    let (gram, right) = (transposed.dot(terms), transposed.dot(targets));
    let mut gram = to_matrix(&gram);
    for i in 1..gram.nrows() {
        gram[(i, i)] += ridge;
    }
    let solution = gram.cholesky()?.solve(&to_matrix(&right));
    let finite = solution.iter().all(|v| v.is_finite());
    finite.then(|| to_array(&solution))
}

/// The quadratic layer. The network learns its residuals: where q is nearly right, the network need not learn it anew.
#[derive(Debug, Clone, PartialEq)]
pub struct QuadraticLayer {
    pub quadratic: Quadratic,
    /// r, for each target.
    pub residual: Vec<f64>,
    /// α, for each target.
    pub weight: Vec<f64>,
}

impl QuadraticLayer {
    /// Fits inputs z to standardised targets; `None` where numbers are not finite.
    pub fn fit(z: &Array2<f64>, targets: &Array2<f64>) -> Option<Self> {
        let quadratic = Quadratic::fit(z, targets, BUDGET.layer_ridge)?;
        Some(Self {
            residual: Scaler::fit(&(targets - &quadratic.predict(z))).scale,
            weight: vec![1.0; targets.ncols()],
            quadratic,
        })
    }

    /// y, from what the network says.
    fn join(&self, z: &Array2<f64>, said: &Array2<f64>) -> Array2<f64> {
        let unit = &aview1(&self.weight) * &aview1(&self.residual);
        self.quadratic.predict(z) + said * &unit
    }

    /// Returns the residuals of q, in units r: the network's targets.
    pub fn rest(&self, z: &Array2<f64>, targets: &Array2<f64>) -> Array2<f64> {
        (targets - &self.quadratic.predict(z)) / aview1(&self.residual)
    }

    /// Sets α by least squares on draws that the network never saw, within [0, 1]: where it has nothing to add, the
    /// quadratic map stays as it is.
    pub fn weigh(&mut self, rest: &Array2<f64>, said: &Array2<f64>) {
        for (j, weight) in self.weight.iter_mut().enumerate() {
            let (said, rest) = (said.column(j), rest.column(j));
            let alpha = said.dot(&rest) / said.dot(&said);
            *weight = match alpha.is_finite() {
                true => alpha.clamp(0.0, 1.0),
                false => 0.0,
            };
        }
    }
}

/// Predictions on simulations that the network was not trained on, beside the truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// Predicted parameters, one simulation a row.
    pub predicted: Array2<f64>,
    /// The parameters simulated.
    pub truth: Array2<f64>,
}

/// Parameters with their errors.
#[derive(Debug, Clone)]
pub struct PointEstimate {
    /// Values, within the bounds.
    pub theta: Vec<f64>,
    /// Standard errors.
    pub std_error: Vec<f64>,
    /// Lower ends of the 90 % interval, within the bounds.
    pub low: Vec<f64>,
    /// Upper ends.
    pub high: Vec<f64>,
}

impl PointEstimate {
    /// Creates an estimate whose interval ends lie these offsets away.
    fn new(
        theta: Vec<f64>,
        std_error: Vec<f64>,
        [low, high]: [Vec<f64>; 2],
        space: &ParameterSpace,
    ) -> Self {
        let shifted = |by: &[f64]| {
            let moved: Vec<f64> = theta.iter().zip(by).map(|(t, b)| t + b).collect();
            space.clamp(&moved)
        };
        Self {
            low: shifted(&low),
            high: shifted(&high),
            std_error,
            theta,
        }
    }

    /// Creates an estimate with normal errors of these standard deviations.
    pub fn normal(theta: Vec<f64>, std_error: Vec<f64>, space: &ParameterSpace) -> Self {
        let reach = Normal::standard().inverse_cdf(0.5 + 0.5 * INTERVAL_LEVEL);
        let ends = [-reach, reach].map(|reach| std_error.iter().map(|s| reach * s).collect());
        Self::new(theta, std_error, ends, space)
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
    pub fn truths_near(&self, prediction: &[f64], widths: &[f64]) -> Vec<Vec<f64>> {
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
        ascending(&mut nearest, |a| a.0);
        nearest.truncate(BUDGET.neighbours);
        nearest.into_iter().map(|(_, i)| i).collect()
    }

    /// The prediction θ with the errors of the simulations whose predictions lie nearest, distances in `widths`; ends are the quantiles
    /// (1 ± [`INTERVAL_LEVEL`])/2 of these errors. `None` without simulations.
    pub fn estimate(
        &self,
        theta: Vec<f64>,
        widths: &[f64],
        space: &ParameterSpace,
    ) -> Option<PointEstimate> {
        let nearest = self.nearest(&theta, widths);
        let (mut std_error, mut ends) = (vec![], [vec![], vec![]]);
        for j in 0..theta.len() {
            let errors: Vec<f64> = (nearest.iter())
                .map(|&i| self.truth[[i, j]] - self.predicted[[i, j]])
                .collect();
            std_error.push(norm(&errors) / (errors.len().max(1) as f64).sqrt());
            let tail = tail(errors.len(), 0.5 - 0.5 * INTERVAL_LEVEL);
            ends[0].push(quantile(&errors, tail).ok()?);
            ends[1].push(quantile(&errors, 1.0 - tail).ok()?);
        }
        Some(PointEstimate::new(theta, std_error, ends, space))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::{Noise, Parameter};

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
        let (trials, wide) = (1000, Parameter::new("theta", "", -9.0, 9.0));
        let space = ParameterSpace::new([wide]);
        let covered = (0..trials).filter(|&i| {
            let (theta, predicted) = draw(i, "trial");
            let estimate = calibration
                .estimate(vec![predicted], &[1.0], &space)
                .unwrap();
            (estimate.low[0]..=estimate.high[0]).contains(&theta)
        });
        let bounds = crate::math::binomial_bounds(trials, 0.9, 0.999).unwrap();
        let covered = covered.count() as u64;
        // A hundred neighbours blur the ends a little: allow one percent more.
        assert!(
            covered + 10 >= *bounds.start() && covered <= *bounds.end() + 10,
            "{covered}"
        );
    }

    /// α is the share of what the network says that holds on draws it never saw.
    #[test]
    fn the_network_is_trusted_as_far_as_it_is_right() {
        let z = Array2::from_shape_fn((50, 1), |(i, _)| (i as f64 - 24.5) / 15.0);
        let mut layer = QuadraticLayer::fit(&z, &z).unwrap();
        let rest = Array2::from_shape_fn((50, 1), |(i, _)| if i % 2 == 0 { 1.0 } else { -1.0 });
        for (said, expected) in [(2.0, 0.5), (0.5, 1.0), (-1.0, 0.0), (0.0, 0.0)] {
            layer.weigh(&rest, &(&rest * said));
            assert_eq!(layer.weight, [expected], "{said}");
        }
    }

    fn inputs(rows: usize) -> Array2<f64> {
        let mut source = Noise::new(1, "quadratic", 0).source("z");
        Array2::from_shape_simple_fn((rows, 6), || source.normal())
    }

    /// Targets that are curved along their own linear estimates come out but for the ridge.
    #[test]
    fn curved_targets_are_found() {
        let z = inputs(500);
        let targets = Array2::from_shape_fn((500, 2), |(i, j)| {
            let (a, b) = (z[[i, 0]] + 0.5 * z[[i, 1]], z[[i, 2]]);
            [1.0 + 3.0 * a + 0.2 * a * b, 3.0 * b - 0.1 * a * a][j]
        });
        let map = Quadratic::fit(&z, &targets, 1e-6).unwrap();
        let worst = (map.predict(&z) - &targets).fold(0.0f64, |w, e| w.max(e.abs()));
        let linear = with_constant(&z).dot(&map.linear) - &targets;
        let without = linear.fold(0.0f64, |w, e| w.max(e.abs()));
        assert!(worst < 0.1 * without, "{worst} {without}");
    }

    /// Noise alone: the ridge and the number of rows keep the map near the mean.
    #[test]
    fn nothing_is_made_of_noise() {
        let z = inputs(1000);
        let mut source = Noise::new(2, "quadratic", 0).source("y");
        let targets = Array2::from_shape_simple_fn((1000, 1), || source.normal());
        let map = Quadratic::fit(&z, &targets, 1.0).unwrap();
        // Eight coefficients of a thousand rows: mean square 0.008.
        let square = map.predict(&z).mapv(|v| v * v).mean().unwrap();
        assert!(square < 0.03, "{square}");
    }

    #[test]
    fn numbers_that_are_not_finite_give_no_map() {
        let z = Array2::from_elem((9, 2), f64::NAN);
        assert_eq!(Quadratic::fit(&z, &Array2::zeros((9, 1)), 1.0), None);
    }

    #[test]
    fn there_and_back_with_a_constant_column() {
        let samples = Array2::from_shape_fn((9, 5), |(i, j)| match j {
            0 => i as f64,
            1 => 0.1,
            2 => 1e-9 * (i as f64).sin(),
            3 => 1e200 * (i as f64).sin(),
            _ => 1e-200 * (i as f64).sin(),
        });
        let scaler = Scaler::fit(&samples);
        let z = scaler.apply(&samples);
        assert!(z.column(1).iter().all(|v| v.abs() < 1e-12));
        for j in 2..5 {
            assert!((z.column(j).std(0.0) - 1.0).abs() < 1e-9, "column {j}");
        }
        let back = scaler.invert(&z);
        let off = (&back - &samples) / aview1(&scaler.scale);
        assert!(off.iter().all(|d| d.abs() < 1e-14));
    }

    /// Two features that differ by a thousandth of their size, a third in another unit, a fourth constant.
    fn samples() -> Array2<f64> {
        let mut all = Array2::zeros((400, 4));
        let mut source = Noise::new(1, "standardiser", 0).source("x");
        for mut row in all.rows_mut() {
            let common = source.normal();
            row[0] = common;
            row[1] = common + 1e-3 * source.normal();
            row[2] = 1e-6 * source.normal();
            row[3] = 5.0;
        }
        all
    }

    #[test]
    fn principal_inputs_are_uncorrelated_and_show_small_differences() {
        let samples = samples();
        let z = (Standardiser::principal(&samples, f64::INFINITY).unwrap()).apply(&samples);
        let covariance = z.t().dot(&z) / 399.0;
        for (at, value) in covariance.indexed_iter() {
            let expected = if at.0 == at.1 && at.0 < 3 { 1.0 } else { 0.0 };
            assert!((value - expected).abs() < 1e-6, "{at:?}: {value}");
        }
    }

    #[test]
    fn inputs_far_outside_are_limited() {
        let samples = samples();
        let far = Array2::from_elem((1, 4), 1e9);
        let z = (Standardiser::principal(&samples, 6.0).unwrap()).apply(&far);
        assert!(z.iter().all(|v| v.abs() <= 6.0) && z.iter().any(|v| v.abs() == 6.0));
    }

    #[test]
    fn each_is_the_scaler() {
        let samples = samples();
        let difference =
            Standardiser::each(&samples).apply(&samples) - Scaler::fit(&samples).apply(&samples);
        assert!(difference.iter().all(|d| d.abs() < 1e-12));
    }
}
