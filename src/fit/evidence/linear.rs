//! Evidence of a function where the likelihood is quadratic in its coefficients: for screens.

use super::sizes::sizes;
use crate::math::log_mean;
use nalgebra::{DMatrix, DVector};

/// log Z of coefficients β over that of none, averaged over the sizes and weights of their prior, in nats:
///
/// ```text
/// ll(β) = bᵀβ − ½·βᵀFβ,   β ~ N(0, τ²·Λ):   log Z = Σ_i ½·τ²·y_i²/(1 + τ²·λ_i) − ½·log(1 + τ²·λ_i)
/// Λ^½·F·Λ^½ = V·diag(λ)·Vᵀ,   y = Vᵀ·Λ^½·b
/// ```
pub(crate) fn linear_evidence(
    slope: &DVector<f64>,
    information: &DMatrix<f64>,
    (weights, largest): (&[Vec<f64>], f64),
) -> f64 {
    let mut all = vec![];
    for weights in weights {
        let roots = DVector::from_iterator(weights.len(), weights.iter().map(|w| w.sqrt()));
        let scaled = DMatrix::from_fn(roots.len(), roots.len(), |a, b| {
            roots[a] * information[(a, b)] * roots[b]
        });
        let eigen = scaled.symmetric_eigen();
        let along = eigen.eigenvectors.tr_mul(&slope.component_mul(&roots));
        let most = eigen.eigenvalues.max().max(1e-300);
        for size in sizes(most, largest) {
            let square = size * size;
            let each = eigen.eigenvalues.iter().zip(along.iter());
            let each = each.map(|(lambda, y)| {
                let spread = 1.0 + square * lambda.max(0.0);
                0.5 * square * y * y / spread - 0.5 * spread.ln()
            });
            all.push(each.sum());
        }
    }
    log_mean(&all)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One coefficient of one weight: the mean over sizes of a ratio of two normal densities.
    #[test]
    fn one_coefficient_is_a_ratio_of_normals() {
        let (b, f, largest) = (6.0, 4.0, 8.0);
        let found = linear_evidence(
            &DVector::from_element(1, b),
            &DMatrix::from_element(1, 1, f),
            (&[vec![1.0]], largest),
        );
        let each: Vec<f64> = (0..6)
            .map(|i| 0.5 * (largest / 0.5f64).powf(f64::from(i) / 5.0))
            .map(|tau| {
                // log of N(b/f; 0, 1/f + τ²) over N(b/f; 0, 1/f).
                let (mean, own) = (b / f, 1.0 / f);
                let both = own + tau * tau;
                0.5 * (own / both).ln() + 0.5 * mean * mean * (1.0 / own - 1.0 / both)
            })
            .collect();
        assert!((found - log_mean(&each)).abs() < 1e-12, "{found}");
    }
}
