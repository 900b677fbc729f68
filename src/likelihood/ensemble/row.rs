//! Prediction of one row from the rows before it: least squares over the runs.

use super::runs::Ensemble;
use nalgebra::DMatrix;

/// Regression of one row on the rows before it.
#[derive(Debug, Clone)]
pub(super) struct RowPrediction {
    /// Outputs that it is predicted from, by row before it and channel.
    pub past: Vec<(usize, usize)>,
    /// B, transposed: outputs × regressors.
    pub weights: DMatrix<f64>,
    /// Inverse of the root of A.
    pub whitening: DMatrix<f64>,
    /// Σ.
    pub covariance: DMatrix<f64>,
}

/// Fits row `k` to outputs of rows before it.
pub(super) fn row(
    ensemble: &Ensemble,
    k: usize,
    past: Vec<(usize, usize)>,
    floors: &[f64],
) -> RowPrediction {
    let p = ensemble.outputs();
    let m = ensemble.runs as f64;
    let n = past.len();
    let at = |i: usize| ensemble.of(past[i].0, past[i].1);
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let mut gram = DMatrix::zeros(n, n);
    for i in 0..n {
        for j in 0..=i {
            gram[(i, j)] = dot(at(i), at(j));
            gram[(j, i)] = gram[(i, j)];
        }
        gram[(i, i)] = gram[(i, i)] * (1.0 + 1e-12) + m * floors[past[i].1];
    }
    let cross = DMatrix::from_fn(n, p, |i, j| dot(at(i), ensemble.of(k, j)));
    let mut own = DMatrix::from_fn(p, p, |i, j| dot(ensemble.of(k, i), ensemble.of(k, j)));
    for j in 0..p {
        own[(j, j)] = own[(j, j)] * (1.0 + 1e-12) + m * floors[j];
    }
    let root = gram.cholesky();
    let whitening = root
        .and_then(|c| {
            let mut inverse = DMatrix::identity(n, n);
            c.l_dirty()
                .solve_lower_triangular_mut(&mut inverse)
                .then_some(inverse)
        })
        .unwrap_or_else(|| DMatrix::zeros(n, n));
    // Of Z·eᵀ in the coordinates in which Z Zᵀ = 1.
    let along = &whitening * cross;
    let covariance = (own - along.tr_mul(&along)) / (m - 1.0 - n as f64).max(1.0);
    let mut covariance = 0.5 * (&covariance + covariance.transpose());
    for j in 0..p {
        covariance[(j, j)] = covariance[(j, j)].max(floors[j]);
    }
    RowPrediction {
        weights: along.tr_mul(&whitening),
        whitening,
        covariance,
        past,
    }
}
