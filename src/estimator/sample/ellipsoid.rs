//! Draws from the confidence ellipsoid of an estimate.

use super::sampler::Sampler;
use crate::estimator::error::EstimatorError;
use crate::twin::Noise;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Gaussian draws whose covariance is the inverse of an information matrix.
///
/// With information `G` and its Cholesky factor `G = L Lᵀ`, a draw is
///
/// ```text
/// θ = centre + L⁻ᵀ z,   z ~ N(0, I),   so that   Cov θ = G⁻¹
/// ```
///
/// and `(θ − centre)ᵀ G (θ − centre)` follows χ² with `d` degrees of freedom. No inverse is formed: one
/// triangular solve a draw, O(d²).
///
/// Source: Lakshminarayanan, Guerrero & Rojas, section IV-B, confidence-set sampling.
#[derive(Debug, Clone)]
pub struct Ellipsoid {
    centre: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
}

impl Ellipsoid {
    /// Around `centre` (length d, the parameters' own units) with `information` (d × d, inverse square units).
    pub fn new(centre: DVector<f64>, information: DMatrix<f64>) -> Result<Self, EstimatorError> {
        let (rows, columns) = information.shape();
        if rows != centre.len() || columns != centre.len() {
            return Err(EstimatorError::Cloud(format!(
                "centre has {} parameters, information is {rows} by {columns}; both need the same number",
                centre.len()
            )));
        }
        let flat = "information is not positive definite; add λ > 0 to its diagonal, or sample along sensitivities";
        let factor = (information.cholesky()).ok_or_else(|| EstimatorError::Cloud(flat.into()))?;
        Ok(Self { centre, factor })
    }
}

impl Sampler for Ellipsoid {
    fn draw(&self, _index: u64, noise: Noise) -> DVector<f64> {
        let mut source = noise.source("ellipsoid");
        let z = DVector::from_fn(self.centre.len(), |_, _| source.normal());
        // A Cholesky factor has a positive diagonal, so the solve cannot fail.
        let step = self
            .factor
            .l_dirty()
            .ad_solve_lower_triangular(&z)
            .expect("positive diagonal");
        &self.centre + step
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ChiSquared, ContinuousCDF};

    fn correlated() -> DMatrix<f64> {
        DMatrix::from_row_slice(2, 2, &[50.0, -30.0, -30.0, 20.0])
    }

    /// The squared distance is χ²_d: the empirical and exact distributions differ by less than the
    /// Kolmogorov–Smirnov bound at 1e-4.
    #[test]
    fn squared_distance_is_chi_squared() {
        let (n, information) = (4000, correlated());
        let ellipsoid = Ellipsoid::new(DVector::zeros(2), information.clone()).unwrap();
        let mut distance: Vec<f64> = (0..n)
            .map(|i| ellipsoid.draw(i, Noise::new(7, "test", i)))
            .map(|theta| (theta.transpose() * &information * theta)[0])
            .collect();
        distance.sort_by(f64::total_cmp);
        let exact = ChiSquared::new(2.0).unwrap();
        let gap = distance
            .iter()
            .enumerate()
            .map(|(i, s)| (exact.cdf(*s) - (i as f64 + 0.5) / n as f64).abs())
            .fold(0.0, f64::max);
        assert!(
            gap < 2.23 / (n as f64).sqrt(),
            "Kolmogorov–Smirnov distance {gap}"
        );
    }

    #[test]
    fn a_flat_direction_is_refused_with_the_remedy() {
        let flat = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 0.0]));
        let error = Ellipsoid::new(DVector::zeros(2), flat).unwrap_err();
        assert!(error.to_string().contains("add λ > 0"));
    }
}
