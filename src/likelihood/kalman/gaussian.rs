//! A mean and a covariance that may be singular.

use super::size::Buffer;
use crate::math::{Condition, Kernel, Number, widest};

/// Pivots below this share of their variance are rounding.
const RELATIVE_PIVOT: f64 = 1e-15;
/// Pivots below this share of their squared mean are rounding.
const ABSOLUTE_PIVOT: f64 = 1e-28;

/// Mean (n) and covariance (n × n, row-major, both triangles).
#[derive(Debug, Clone)]
pub(crate) struct Gaussian {
    pub mean: Vec<f64>,
    pub cov: Vec<f64>,
}

impl Gaussian {
    pub(super) fn zero(n: usize) -> Self {
        Self {
            mean: vec![0.0; n],
            cov: vec![0.0; n * n],
        }
    }

    pub(super) fn of(belief: Belief<'_>) -> Self {
        Self {
            mean: belief.mean.to_vec(),
            cov: belief.cov.to_vec(),
        }
    }

    pub(super) fn as_belief(&self) -> Belief<'_> {
        Belief {
            mean: &self.mean,
            cov: &self.cov,
        }
    }

    /// Standard deviation of an entry.
    pub fn deviation(&self, i: usize) -> f64 {
        self.cov[i * self.mean.len() + i].max(0.0).sqrt()
    }
}

/// A look at a mean and a covariance.
#[derive(Debug, Clone, Copy)]
pub(super) struct Belief<'w, N = f64> {
    pub mean: &'w [N],
    pub cov: &'w [N],
}

/// A root of a covariance: columns L_j with P = Σ L_j L_jᵀ, one after the other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Columns<'w, N = f64> {
    pub all: &'w [N],
    pub rank: usize,
}

impl<'w, N> Columns<'w, N> {
    /// As many as states.
    #[inline(always)]
    pub fn all(n: usize, all: &'w [N]) -> Self {
        Self { all, rank: n }
    }

    #[inline(always)]
    pub fn each(self, n: usize) -> std::slice::ChunksExact<'w, N> {
        self.all[..self.rank * n].chunks_exact(n)
    }
}

/// Cholesky's columns of a covariance (n × n, row-major) whose pivots are all above rounding; whether they are. No
/// square root waits for another.
#[inline(always)]
pub(super) fn regular<N: Number>(mean: &[N], cov: &[N], columns: &mut [N]) -> bool {
    let n = mean.len();
    let (cov, columns) = (&cov[..n * n], &mut columns[..n * n]);
    let mut regular = true;
    // C·D·Cᵀ: column j of C·D in row j from the pivot on, row j of C before it.
    for j in 0..n {
        let variance = cov[j * n + j];
        for i in j..n {
            let mut entry = cov[i * n + j];
            for k in 0..j {
                entry = entry - columns[k * n + i] * columns[j * n + k];
            }
            columns[j * n + i] = entry;
            if i > j {
                columns[i * n + j] = entry / columns[j * n + j];
            }
        }
        // Not so where it is NaN.
        let counts = least_pivot(mean[j], variance).below(columns[j * n + j]);
        regular &= !(!counts).any();
    }
    for j in 0..n {
        let root = columns[j * n + j].sqrt();
        columns[j * n + j] = root;
        for i in j + 1..n {
            columns[j * n + i] = columns[i * n + j] * root;
            columns[i * n + j] = N::ZERO;
        }
    }
    regular
}

#[inline(always)]
fn least_pivot<N: Number>(mean: N, variance: N) -> N {
    variance * RELATIVE_PIVOT + mean * mean * ABSOLUTE_PIVOT
}

/// Cholesky's columns, without those whose pivot is zero; lanes keep them, as zeros.
///
/// A state known exactly has no column, and so costs no point. Pivots count as zero where they are rounding: far below the
/// noise floor, so that a state measured without noise keeps what it is known by.
#[derive(Debug, Clone)]
pub(super) struct Root<M = Vec<f64>> {
    all: M,
    rank: usize,
}

impl<M> Root<M> {
    #[inline(always)]
    pub fn new<N: Number>(n: usize) -> Self
    where
        M: Buffer<N>,
    {
        Self {
            all: M::zeros(n * n),
            rank: 0,
        }
    }

    #[inline(always)]
    pub fn columns<N: Number>(&self) -> Columns<'_, N>
    where
        M: Buffer<N>,
    {
        Columns {
            all: self.all.numbers(),
            rank: self.rank,
        }
    }

    /// Factors a covariance (n × n, row-major).
    #[inline(always)]
    pub fn factor<N: Number>(&mut self, mean: &[N], cov: &[N])
    where
        M: Buffer<N>,
    {
        let all = self.all.numbers_mut();
        let factor = Factor { mean, cov, all };
        // Lanes run in the widest vectors already.
        self.rank = match N::LANES {
            1 => widest(factor),
            _ => factor.run(),
        };
    }
}

impl Root {
    /// A solution of P·x = b in place, for b in the range of P; components without a pivot become zero.
    pub fn solve(&self, b: &mut [f64]) {
        let n = b.len();
        let mut forward = [0.0; 64];
        let mut heap = vec![0.0; if self.rank > 64 { self.rank } else { 0 }];
        let z = if heap.is_empty() {
            &mut forward[..self.rank]
        } else {
            &mut heap[..]
        };
        for (c, column) in self.columns().each(n).enumerate() {
            let pivot = pivot_of(column);
            z[c] = b[pivot] / column[pivot];
            for i in pivot..n {
                b[i] -= z[c] * column[i];
            }
        }
        b.fill(0.0);
        for (c, column) in self.columns().each(n).enumerate().rev() {
            let pivot = pivot_of(column);
            let known: f64 = (pivot + 1..n).map(|i| column[i] * b[i]).sum();
            b[pivot] = (z[c] - known) / column[pivot];
        }
    }
}

/// Columns of a root, one after the other; their number.
struct Factor<'w, N> {
    mean: &'w [N],
    cov: &'w [N],
    all: &'w mut [N],
}

impl<N: Number> Kernel for Factor<'_, N> {
    type Output = usize;

    #[inline(always)]
    fn run(self) -> usize {
        let Self { mean, cov, all } = self;
        let n = mean.len();
        let mut rank = 0;
        for j in 0..n {
            let (done, rest) = all.split_at_mut(rank * n);
            let column = &mut rest[..n];
            column[..j].fill(N::ZERO);
            for i in j..n {
                column[i] = cov[i * n + j];
            }
            // Along the column inside, so that the sums go side by side.
            for before in done.chunks_exact(n) {
                let share = before[j];
                for (entry, before) in column[j..].iter_mut().zip(&before[j..]) {
                    *entry = *entry - *before * share;
                }
            }
            let pivot = column[j];
            // Not so where it is NaN: that shows in the innovation.
            let counts = least_pivot(mean[j], cov[j * n + j]).below(pivot);
            if N::LANES == 1 && !counts.any() {
                continue;
            }
            let inverse = counts.select(pivot, N::all(1.0)).sqrt().recip();
            for entry in &mut column[j..] {
                *entry = counts.select(*entry * inverse, N::ZERO);
            }
            rank += 1;
        }
        rank
    }
}

/// Row of a column's first entry that is not zero.
fn pivot_of(column: &[f64]) -> usize {
    column.iter().position(|l| *l != 0.0).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn product(root: &Root, n: usize) -> Vec<f64> {
        let mut all = vec![0.0; n * n];
        for column in root.columns::<f64>().each(n) {
            for i in 0..n {
                for j in 0..n {
                    all[i * n + j] += column[i] * column[j];
                }
            }
        }
        all
    }

    /// Both ways give the same columns where all pivots count.
    #[test]
    fn a_regular_covariance_has_the_same_columns_either_way() {
        let (mean, cov) = ([1.0; 3], [4.0, 1.0, 0.5, 1.0, 3.0, -1.0, 0.5, -1.0, 2.0]);
        let mut root = <Root>::new(3);
        root.factor(&mean, &cov);
        let mut columns = [7.0; 9];
        assert!(regular(&mean, &cov, &mut columns));
        for (a, b) in columns.iter().zip(root.columns().all) {
            assert!((a - b).abs() < 1e-15);
        }
        assert!(!regular(&mean, &[1.0; 9], &mut columns));
    }

    /// Rank two in three states, one of them known.
    #[test]
    fn a_singular_covariance_has_as_many_columns_as_its_rank() {
        let (a, b) = ([1.0, 0.0, 2.0], [0.0, 0.0, 1e-6]);
        let mut state = Gaussian::zero(3);
        state.mean = vec![1.0, 5.0, 1.0];
        for i in 0..3 {
            for j in 0..3 {
                state.cov[i * 3 + j] = a[i] * a[j] + b[i] * b[j];
            }
        }
        let mut root = <Root>::new(3);
        root.factor(&state.mean, &state.cov);
        assert_eq!(root.rank, 2);
        for (made, given) in product(&root, 3).iter().zip(&state.cov) {
            assert!((made - given).abs() < 1e-15);
        }
        // P·x = P·[1, 9, −1] up to what P does not see.
        let mut x = [0.0; 3];
        for (i, x) in x.iter_mut().enumerate() {
            *x = state.cov[i * 3] - state.cov[i * 3 + 2];
        }
        let given = x;
        root.solve(&mut x);
        for (i, given) in given.iter().enumerate() {
            let back: f64 = (0..3).map(|j| state.cov[i * 3 + j] * x[j]).sum();
            assert!((back - given).abs() < 1e-9, "{back} {given}");
        }
    }
}
