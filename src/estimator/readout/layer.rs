//! The quadratic layer beside the heads: a quadratic map from features to parameters, fitted by ridge regression.

use super::Scaler;
use crate::math::{to_array, to_matrix};
use ndarray::{Array2, Axis, aview1, concatenate};

/// Weight of a row of zeros in the ridge regression of the quadratic layer.
const RIDGE: f64 = 1.0;

/// ŷ = B·[1, z, s⊗s], where s = A·[1, z] is the best linear estimate of the targets; n features, d targets.
///
/// Squares and products are those of the d linear estimates, not of all features: a curved map needs d(d + 1)/2 more
/// terms, whatever n is. Both fits are ridge regressions, the constant left free.
///
/// Source: Beaumont, Zhang & Balding, "Approximate Bayesian computation in population genetics", *Genetics* 162 (2002), for
/// regression on a cloud of simulations.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::estimator) struct Quadratic {
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
    pub(in crate::estimator) quadratic: Quadratic,
    /// r, for each target.
    pub residual: Vec<f64>,
    /// α, for each target.
    pub weight: Vec<f64>,
}

impl QuadraticLayer {
    /// Fits inputs z to standardised targets; `None` where numbers are not finite.
    pub fn fit(z: &Array2<f64>, targets: &Array2<f64>) -> Option<Self> {
        let quadratic = Quadratic::fit(z, targets, RIDGE)?;
        Some(Self {
            residual: Scaler::fit(&(targets - &quadratic.predict(z))).scale,
            weight: vec![1.0; targets.ncols()],
            quadratic,
        })
    }

    /// y, from what the network says.
    pub(super) fn join(&self, z: &Array2<f64>, said: &Array2<f64>) -> Array2<f64> {
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
            *weight = if alpha.is_finite() {
                alpha.clamp(0.0, 1.0)
            } else {
                0.0
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Noise;

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
}
