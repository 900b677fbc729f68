//! The one place that asks faer for a Cholesky factor.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{cholesky_in_place, cholesky_in_place_scratch};
use faer::{MatMut, Par};
use nalgebra::DMatrix;

/// Lanes in which dot products run, whatever the width of the processor's vectors.
const LANES: usize = 8;

/// `A = L Lᵀ` of a symmetric positive definite matrix.
///
/// faer rather than nalgebra: three times as fast at 128 × 128. Substitution is written out here, for one right side.
#[derive(Debug, Clone)]
pub(super) struct Cholesky {
    /// L in its lower triangle; what stands above is undefined.
    lower: DMatrix<f64>,
}

impl Cholesky {
    /// Of the lower triangle of `matrix`; `None` where it is not positive definite.
    pub(super) fn new(mut matrix: DMatrix<f64>) -> Option<Self> {
        let n = matrix.nrows();
        let mut memory = MemBuffer::new(cholesky_in_place_scratch::<f64>(
            n,
            Par::Seq,
            Default::default(),
        ));
        cholesky_in_place(
            MatMut::from_column_major_slice_mut(matrix.as_mut_slice(), n, n),
            Default::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        )
        .ok()?;
        Some(Self { lower: matrix })
    }

    /// Overwrites `x` by A⁻¹ x.
    pub(super) fn solve(&self, x: &mut [f64]) {
        let lower = self.lower.as_slice();
        pulp::Arch::new().dispatch(Substitution { lower, x });
    }
}

/// x ← L⁻ᵀ L⁻¹ x, to be compiled for the widest vectors of the processor. A closure in its place is not inlined, and so
/// compiled for the narrowest.
struct Substitution<'a> {
    lower: &'a [f64],
    x: &'a mut [f64],
}

impl pulp::NullaryFnOnce for Substitution<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { lower, x } = self;
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
}

/// Σ a·b.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
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
        for n in [0, 1, 3, 40, 130] {
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
