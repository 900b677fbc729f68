use super::MathError;
use nalgebra::{DMatrix, DVector};

use super::svd::thin_svd;

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
) -> Result<TruncatedSolution, MathError> {
    // The decomposition reports NaN by not converging; an infinity or a bad right side would pass silently.
    let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
    if !finite(matrix.as_slice()) || !finite(right_side.as_slice()) {
        return Err(MathError::NotFinite);
    }
    let svd = thin_svd(matrix).ok_or(MathError::NotFinite)?;
    let threshold = relative_cutoff * svd.values.iter().copied().fold(0.0, f64::max);
    let rank = svd
        .values
        .iter()
        .take_while(|&&s| s > threshold && s > 0.0)
        .count();
    let kept = svd.values.rows(0, rank);
    let coordinates = svd
        .left
        .columns(0, rank)
        .tr_mul(right_side)
        .component_div(&kept);
    Ok(TruncatedSolution {
        step: svd.right.columns(0, rank) * coordinates,
        rank,
        singular_values: svd.values,
    })
}

/// Solution of [`solve_truncated`].
#[derive(Debug, Clone, PartialEq)]
pub struct TruncatedSolution {
    /// The shortest minimiser over the kept directions, length d.
    pub step: DVector<f64>,
    /// Number of directions kept.
    pub rank: usize,
    /// All singular values, descending, length min(m, d).
    pub singular_values: DVector<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{dmatrix, dvector};

    #[test]
    fn full_rank_agrees_with_the_normal_equations() {
        let j = dmatrix![1.0, 2.0; 0.5, -1.0; 3.0, 0.1];
        let r = dvector![1.0, 2.0, 3.0];
        let expected = (j.tr_mul(&j)).try_inverse().unwrap() * j.tr_mul(&r);
        let solution = solve_truncated(&j, &r, 1e-12).unwrap();
        assert_eq!(solution.rank, 2);
        assert!((solution.step - expected).norm() < 1e-13);
    }

    #[test]
    fn a_direction_below_the_cutoff_does_not_move() {
        let j = DMatrix::from_diagonal(&dvector![1.0, 1e-6]);
        let r = dvector![1.0, 1.0];
        assert_eq!(
            solve_truncated(&j, &r, 1e-3).unwrap().step,
            dvector![1.0, 0.0]
        );
        assert!((solve_truncated(&j, &r, 1e-9).unwrap().step[1] - 1e6).abs() < 1e-3);
    }

    #[test]
    fn edges() {
        let shortest = solve_truncated(&dmatrix![3.0, 4.0], &dvector![25.0], 1e-9).unwrap();
        assert!((shortest.step - dvector![3.0, 4.0]).norm() < 1e-13);
        let zero = solve_truncated(&DMatrix::zeros(3, 2), &dvector![1.0, 2.0, 3.0], 1e-9).unwrap();
        assert_eq!((zero.rank, zero.step), (0, DVector::zeros(2)));
        let empty = solve_truncated(&DMatrix::zeros(3, 0), &DVector::zeros(3), 1e-9).unwrap();
        assert_eq!((empty.rank, empty.step.len()), (0, 0));
        let infinite = dvector![f64::INFINITY, 0.0];
        assert!(solve_truncated(&DMatrix::identity(2, 2), &infinite, 1e-9).is_err());
    }
}
