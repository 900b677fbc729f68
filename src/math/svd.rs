//! Singular value decomposition of tall and wide matrices.

use nalgebra::{DMatrix, DVector, SVD};

/// Steps of the iteration for each singular value; two or three are usual.
const STEPS: usize = 100;

/// `A = U diag(σ) Vᵀ`, thin: with k = min(rows, columns), `left` is rows × k, `right` is columns × k, and
/// `values` descend.
pub(super) struct Svd {
    pub left: DMatrix<f64>,
    pub values: DVector<f64>,
    pub right: DMatrix<f64>,
}

/// Decomposes `matrix`; `None` where an entry is not finite or the iteration does not converge.
///
/// A tall matrix is brought to A = QR first, so that the iteration sees the small square R.
pub(super) fn thin_svd(matrix: &DMatrix<f64>) -> Option<Svd> {
    let (rows, columns) = matrix.shape();
    if matrix.iter().any(|v| !v.is_finite()) {
        return None;
    }
    if rows < columns {
        let turned = thin_svd(&matrix.transpose())?;
        return Some(Svd {
            left: turned.right,
            values: turned.values,
            right: turned.left,
        });
    }
    if columns == 0 {
        return Some(Svd {
            left: DMatrix::zeros(rows, 0),
            values: DVector::zeros(0),
            right: DMatrix::zeros(0, 0),
        });
    }
    let qr = matrix.clone().qr();
    let svd = SVD::try_new(qr.r(), true, true, f64::EPSILON, STEPS * columns)?;
    Some(Svd {
        left: qr.q() * svd.u?,
        values: svd.singular_values,
        right: svd.v_t?.transpose(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn factors_multiply_back_in_every_shape() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for (rows, columns) in [(7, 3), (3, 7), (5, 5), (4, 1), (3, 0), (0, 3)] {
            let matrix = DMatrix::from_fn(rows, columns, |_, _| rng.gen_range(-1.0..1.0));
            let svd = thin_svd(&matrix).unwrap();
            let back = &svd.left * DMatrix::from_diagonal(&svd.values) * svd.right.transpose();
            assert!((back - matrix).amax() < 1e-14);
            assert!(svd.values.as_slice().is_sorted_by(|a, b| a >= b));
        }
    }

    #[test]
    fn not_a_number_ends_without_a_result() {
        let mut matrix = DMatrix::identity(4, 4);
        matrix[(1, 2)] = f64::NAN;
        assert!(thin_svd(&matrix).is_none());
    }

    #[test]
    fn zeros_and_repeated_columns_converge() {
        let repeated = DMatrix::from_fn(9, 4, |i, j| (i + j / 2) as f64);
        for matrix in [
            DMatrix::zeros(5, 3),
            repeated,
            DMatrix::from_element(3, 3, 1e-300),
        ] {
            let svd = thin_svd(&matrix).unwrap();
            let back = &svd.left * DMatrix::from_diagonal(&svd.values) * svd.right.transpose();
            assert!((back - &matrix).amax() <= 1e-14 * matrix.amax());
            assert!(svd.values.as_slice().is_sorted_by(|a, b| a >= b));
        }
    }
}
