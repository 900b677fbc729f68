//! Principal axes of a covariance.

use nalgebra::{DMatrix, SymmetricEigen};

/// Columns: eigenvectors of a finite covariance (d × d, d ≥ 1), each one standard deviation long.
pub(crate) fn principal_axes(covariance: DMatrix<f64>) -> DMatrix<f64> {
    let eigen = SymmetricEigen::new(covariance);
    // Rounding may leave an eigenvalue below zero.
    let lengths = eigen.eigenvalues.map(|v| v.max(0.0).sqrt());
    eigen.eigenvectors * DMatrix::from_diagonal(&lengths)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_multiply_to_the_covariance() {
        let covariance = DMatrix::from_row_slice(2, 2, &[4.0, 1.5, 1.5, 1.0]);
        let axes = principal_axes(covariance.clone());
        assert!((&axes * axes.transpose() - covariance).amax() < 1e-12);
    }
}
