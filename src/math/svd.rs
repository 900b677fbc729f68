//! Singular value decomposition, and what follows from it and its relatives.

use super::MathError;
use super::cholesky::dot;
use super::widest::widest;
use crate::math::descending;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Sweeps over all pairs of columns; six to ten are usual.
const SWEEPS: usize = 60;

/// `A = U diag(σ) Vᵀ`, thin: with k = min(rows, columns), `left` is rows × k, `right` is columns × k, and
/// `values` descend. A singular value of zero may have a vector of zeros on the longer side.
pub(crate) struct Svd {
    pub left: DMatrix<f64>,
    pub values: DVector<f64>,
    pub right: DMatrix<f64>,
}

/// Decomposes `matrix`; `None` where an entry is not finite or the iteration does not converge.
///
/// A tall matrix is brought to A = QR; then the columns of R are rotated in pairs until they are orthogonal (one-sided
/// Jacobi). nalgebra's own decomposition is not used: it does not multiply back to a 30 × 20 matrix of rank 4 (off by
/// as much as its entries), and among 5000 random 7 × 3 matrices was off by up to 6e-11, this one by 3e-15.
pub(crate) fn thin_svd(matrix: &DMatrix<f64>) -> Option<Svd> {
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
    // Squares of what is near one neither overflow nor vanish.
    let size = match matrix.amax() {
        0.0 => 1.0,
        largest => largest,
    };
    let qr = (matrix / size).qr();
    let mut rotated = qr.r();
    let mut right = DMatrix::identity(columns, columns);
    let (a, v) = (rotated.as_mut_slice(), right.as_mut_slice());
    if !widest(
        #[inline(always)]
        || rotate(columns, a, v),
    ) {
        return None;
    }
    let norms: Vec<f64> = rotated.column_iter().map(|c| c.norm()).collect();
    let mut order: Vec<usize> = (0..columns).collect();
    descending(&mut order, |&i| norms[i]);
    let mut left = rotated.select_columns(&order);
    let values = DVector::from_iterator(columns, order.iter().map(|&j| norms[j]));
    for (mut column, &value) in left.column_iter_mut().zip(values.iter()) {
        if value > 0.0 {
            column /= value;
        }
    }
    Some(Svd {
        left: qr.q() * left,
        values: values * size,
        right: right.select_columns(&order),
    })
}

/// Makes the columns of a square matrix of n rows orthogonal, with the same rotations of `right`; returns `false` where that does not
/// converge.
#[inline(always)]
fn rotate(n: usize, rotated: &mut [f64], right: &mut [f64]) -> bool {
    let rounding = n as f64 * f64::EPSILON;
    // The square of a column that is nothing but rounding; the largest entry was one.
    let zero = rounding * rounding;
    for _ in 0..SWEEPS {
        let mut squares: Vec<f64> = rotated.chunks_exact(n).map(|c| dot(c, c)).collect();
        let mut converged = true;
        for q in 1..n {
            for p in 0..q {
                let [a, b] = pair(rotated, n, p, q);
                let product = dot(a, b);
                let (p_square, q_square) = (squares[p], squares[q]);
                if product.abs() <= rounding * (p_square * q_square).sqrt()
                    || p_square.min(q_square) <= zero
                {
                    continue;
                }
                converged = false;
                let zeta = (q_square - p_square) / (2.0 * product);
                let tangent = zeta.signum() / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
                let cosine = (1.0 + tangent * tangent).sqrt().recip();
                turn([a, b], cosine, cosine * tangent);
                turn(pair(right, n, p, q), cosine, cosine * tangent);
                // Rounding must not make a square negative.
                squares[p] = (p_square - tangent * product).max(0.0);
                squares[q] += tangent * product;
            }
        }
        if converged {
            return true;
        }
    }
    false
}

/// Columns p < q of n rows.
#[inline(always)]
fn pair(matrix: &mut [f64], n: usize, p: usize, q: usize) -> [&mut [f64]; 2] {
    let (before, after) = matrix.split_at_mut(q * n);
    [&mut before[p * n..][..n], &mut after[..n]]
}

#[inline(always)]
fn turn([a, b]: [&mut [f64]; 2], cosine: f64, sine: f64) {
    for (a, b) in a.iter_mut().zip(b) {
        (*a, *b) = (cosine * *a - sine * *b, sine * *a + cosine * *b);
    }
}

/// Least squares that leaves out the directions that the matrix hardly sees.
///
/// With `J = U diag(σ) Vᵀ`, the shortest minimiser of ‖J x − r‖ over the directions that are kept:
///
/// ```text
/// x = Σ_{σ_i > c·σ_max} v_i (u_iᵀ r) / σ_i
/// ```
///
/// `matrix` is m × d, `right_side` has length m, and `relative_cutoff` c lies in [0, 1). A direction below the cutoff
/// gets no component at all: it is not moved by noise divided by nearly zero. Scale the columns first (multiply
/// column j by the natural unit of x_j), because "small" is measured over all columns together. An all-zero or empty
/// matrix has rank 0 and the solution 0. [`MathError::NotFinite`] where an entry is not finite.
///
/// Source: Hansen, *Rank-Deficient and Discrete Ill-Posed Problems* (1998), chapter 3.
pub fn solve_truncated(
    matrix: &DMatrix<f64>,
    right_side: &DVector<f64>,
    relative_cutoff: f64,
) -> Result<DVector<f64>, MathError> {
    // The decomposition reports NaN by not converging; an infinity or a bad right side would pass silently.
    let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
    if !finite(matrix.as_slice()) || !finite(right_side.as_slice()) {
        return Err(MathError::NotFinite);
    }
    let svd = thin_svd(matrix).ok_or(MathError::NotFinite)?;
    let threshold = relative_cutoff * svd.values.iter().copied().fold(0.0, f64::max);
    let is_kept = |s: &&f64| **s > threshold && **s > 0.0;
    let rank = svd.values.iter().take_while(is_kept).count();
    let coordinates = svd.left.columns(0, rank).tr_mul(right_side);
    let coordinates = coordinates.component_div(&svd.values.rows(0, rank));
    Ok(svd.right.columns(0, rank) * coordinates)
}

/// Columns: eigenvectors of a finite covariance (d × d, d ≥ 1), each one standard deviation long.
pub(crate) fn principal_axes(covariance: DMatrix<f64>) -> DMatrix<f64> {
    let eigen = SymmetricEigen::new(covariance);
    // Rounding may leave an eigenvalue below zero.
    let lengths = eigen.eigenvalues.map(|v| v.max(0.0).sqrt());
    eigen.eigenvectors * DMatrix::from_diagonal(&lengths)
}

#[cfg(test)]
mod tests {
    mod decomposition {
        use super::super::*;
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
            let mut rng = ChaCha8Rng::seed_from_u64(4);
            let mut random =
                |rows, columns| DMatrix::from_fn(rows, columns, |_, _| rng.gen_range(-1.0..1.0));
            for matrix in [
                random(30, 4) * random(4, 20),
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

    mod truncated {
        use super::super::*;
        use nalgebra::{dmatrix, dvector};

        #[test]
        fn full_rank_agrees_with_the_normal_equations() {
            let j = dmatrix![1.0, 2.0; 0.5, -1.0; 3.0, 0.1];
            let r = dvector![1.0, 2.0, 3.0];
            let expected = (j.tr_mul(&j)).try_inverse().unwrap() * j.tr_mul(&r);
            let solution = solve_truncated(&j, &r, 1e-12).unwrap();
            assert!((solution - expected).norm() < 1e-13);
        }

        #[test]
        fn a_direction_below_the_cutoff_does_not_move() {
            let j = DMatrix::from_diagonal(&dvector![1.0, 1e-6]);
            let r = dvector![1.0, 1.0];
            assert_eq!(solve_truncated(&j, &r, 1e-3).unwrap(), dvector![1.0, 0.0]);
            assert!((solve_truncated(&j, &r, 1e-9).unwrap()[1] - 1e6).abs() < 1e-3);
        }

        #[test]
        fn edges() {
            let shortest = solve_truncated(&dmatrix![3.0, 4.0], &dvector![25.0], 1e-9).unwrap();
            assert!((shortest - dvector![3.0, 4.0]).norm() < 1e-13);
            let zero =
                solve_truncated(&DMatrix::zeros(3, 2), &dvector![1.0, 2.0, 3.0], 1e-9).unwrap();
            assert_eq!(zero, DVector::zeros(2));
            let empty = solve_truncated(&DMatrix::zeros(3, 0), &DVector::zeros(3), 1e-9).unwrap();
            assert_eq!(empty.len(), 0);
            let infinite = dvector![f64::INFINITY, 0.0];
            assert!(solve_truncated(&DMatrix::identity(2, 2), &infinite, 1e-9).is_err());
        }
    }

    mod axes {
        use super::super::*;

        #[test]
        fn axes_multiply_to_the_covariance() {
            let covariance = DMatrix::from_row_slice(2, 2, &[4.0, 1.5, 1.5, 1.0]);
            let axes = principal_axes(covariance.clone());
            assert!((&axes * axes.transpose() - covariance).amax() < 1e-12);
        }
    }
}
