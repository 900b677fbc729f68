//! Cholesky factors of matrices of up to some hundred rows.

use super::widest::widest;
use nalgebra::DMatrix;

/// Lanes in which dot products run, whatever the width of the processor's vectors.
const LANES: usize = 8;
/// Columns that are factored together, so that each number read serves four sums.
const COLUMNS: usize = 4;

/// `A = L Lᵀ` of a symmetric positive definite matrix.
///
/// Written out, for one right side: 64 µs at 128 × 128 on a busy machine, where nalgebra took 156 µs and faer 91 µs in the same run.
#[derive(Debug, Clone)]
pub(super) struct Cholesky {
    /// L in its lower triangle; the rest is undefined.
    lower: DMatrix<f64>,
}

impl Cholesky {
    /// Factors the lower triangle of `matrix`; `None` where it is not positive definite.
    pub(super) fn new(mut matrix: DMatrix<f64>) -> Option<Self> {
        let rows = matrix.nrows();
        let columns = matrix.as_mut_slice();
        let is_factored = widest(
            #[inline(always)]
            || factor(columns, rows),
        );
        is_factored.then_some(Self { lower: matrix })
    }

    /// Overwrites `x` by A⁻¹ x.
    pub(super) fn solve(&self, x: &mut [f64]) {
        let lower = self.lower.as_slice();
        widest(
            #[inline(always)]
            || substitute(lower, x),
        );
    }
}

/// Overwrites a matrix of `rows` columns by its factor; returns `false` where it has none.
#[inline(always)]
fn factor(columns: &mut [f64], rows: usize) -> bool {
    let mut weights = Vec::with_capacity(rows);
    for first in (0..rows).step_by(COLUMNS) {
        let (before, here) = columns.split_at_mut(first * rows);
        let width = COLUMNS.min(rows - first);
        if width == COLUMNS {
            let earlier = before.chunks_exact(rows);
            weights.clear();
            weights.extend(
                earlier.map(|l| -> [f64; COLUMNS] { std::array::from_fn(|q| l[first + q]) }),
            );
            let mut row = first;
            while row + 16 <= rows {
                subtract_block::<16>(before, &weights, row, here, rows);
                row += 16;
            }
            while row + 4 <= rows {
                subtract_block::<4>(before, &weights, row, here, rows);
                row += 4;
            }
            for row in row..rows {
                subtract_block::<1>(before, &weights, row, here, rows);
            }
        }
        for column in 0..width {
            let diagonal = first + column;
            let (left, this) = here.split_at_mut(column * rows);
            let this = &mut this[diagonal..rows];
            if width < COLUMNS {
                subtract_columns(before, diagonal, this, rows);
            }
            subtract_columns(left, diagonal, this, rows);
            if !(this[0] > 0.0 && this[0].is_finite()) {
                return false;
            }
            this[0] = this[0].sqrt();
            let inverse = 1.0 / this[0];
            for value in &mut this[1..] {
                *value *= inverse;
            }
        }
    }
    true
}

/// Takes what the columns `before` explain from rows `row` … `row + ROWS` of the next four columns.
#[inline(always)]
fn subtract_block<const ROWS: usize>(
    before: &[f64],
    weights: &[[f64; COLUMNS]],
    row: usize,
    here: &mut [f64],
    rows: usize,
) {
    let mut sums = [[0.0; ROWS]; COLUMNS];
    for (column, sums) in sums.iter_mut().enumerate() {
        sums.copy_from_slice(&here[column * rows + row..][..ROWS]);
    }
    for (l, weights) in before.chunks_exact(rows).zip(weights) {
        let l = &l[row..row + ROWS];
        for (sums, weight) in sums.iter_mut().zip(weights) {
            for (sum, l) in sums.iter_mut().zip(l) {
                *sum -= weight * l;
            }
        }
    }
    for (column, sums) in sums.iter().enumerate() {
        here[column * rows + row..][..ROWS].copy_from_slice(sums);
    }
}

/// Takes what the columns `before` explain from one column, given from its diagonal on.
#[inline(always)]
fn subtract_columns(before: &[f64], diagonal: usize, this: &mut [f64], rows: usize) {
    for l in before.chunks_exact(rows) {
        let weight = l[diagonal];
        for (value, l) in this.iter_mut().zip(&l[diagonal..]) {
            *value -= weight * l;
        }
    }
}

/// x ← L⁻ᵀ L⁻¹ x.
#[inline(always)]
fn substitute(lower: &[f64], x: &mut [f64]) {
    let n = x.len();
    for j in 0..n {
        let l = &lower[j * n + j..(j + 1) * n];
        let value = x[j] / l[0];
        x[j] = value;
        for (x, l) in x[j + 1..].iter_mut().zip(&l[1..]) {
            *x -= value * l;
        }
    }
    for j in (0..n).rev() {
        let l = &lower[j * n + j..(j + 1) * n];
        x[j] = (x[j] - dot(&l[1..], &x[j + 1..])) / l[0];
    }
}

/// Σ a·b.
#[inline(always)]
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a, a_rest) = a.as_chunks::<LANES>();
    let (b, b_rest) = b.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for (a, b) in a.iter().zip(b) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_in_every_size_and_refuses_what_is_indefinite() {
        for n in [0, 1, 3, 4, 9, 40, 101, 130] {
            let a = DMatrix::from_fn(n, n, |i, j| {
                1.0 / (1.0 + i.abs_diff(j) as f64) + if i == j { 1.0 } else { 0.0 }
            });
            let exact: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
            let mut x = (&a * DMatrix::from_column_slice(n, 1, &exact))
                .as_slice()
                .to_vec();
            Cholesky::new(a).unwrap().solve(&mut x);
            assert!(x.iter().zip(&exact).all(|(a, b)| (a - b).abs() < 1e-13));
        }
        assert!(Cholesky::new(DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 9.0, 1.0])).is_none());
        assert!(Cholesky::new(DMatrix::from_element(2, 2, f64::NAN)).is_none());
    }
}
