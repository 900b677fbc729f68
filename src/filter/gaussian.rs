//! A mean and a covariance that may be singular.

/// Pivots below this share of their variance are rounding.
const RELATIVE_PIVOT: f64 = 1e-15;
/// Pivots below this share of their squared mean are rounding.
const ABSOLUTE_PIVOT: f64 = 1e-28;

/// Mean (n) and covariance (n × n, row-major, both triangles).
#[derive(Debug, Clone)]
pub(super) struct Gaussian {
    pub mean: Vec<f64>,
    pub cov: Vec<f64>,
}

impl Gaussian {
    pub fn zero(n: usize) -> Self {
        Self {
            mean: vec![0.0; n],
            cov: vec![0.0; n * n],
        }
    }
}

/// Columns L_j with P = Σ L_j L_jᵀ: Cholesky's, without those whose pivot is zero.
///
/// A state known exactly has no column, and so costs no point. Pivots count as zero where they are rounding: far below the
/// noise floor, so that a state measured without noise keeps what it is known by.
#[derive(Debug, Clone)]
pub(super) struct Root {
    columns: Vec<f64>,
    /// Row of each column's first entry that is not zero.
    pivots: Vec<usize>,
}

impl Root {
    pub fn new(n: usize) -> Self {
        Self {
            columns: vec![0.0; n * n],
            pivots: Vec::with_capacity(n),
        }
    }

    /// Number of columns, the rank.
    #[inline]
    pub fn rank(&self) -> usize {
        self.pivots.len()
    }

    /// The columns, one after the other.
    #[inline(always)]
    pub fn columns(&self, n: usize) -> std::slice::ChunksExact<'_, f64> {
        self.columns[..self.rank() * n].chunks_exact(n)
    }

    /// Factors a covariance.
    #[inline(always)]
    pub fn factor(&mut self, n: usize, of: &Gaussian) {
        let (mean, cov) = (&of.mean[..n], &of.cov[..n * n]);
        self.pivots.clear();
        for j in 0..n {
            let rank = self.pivots.len();
            let (done, rest) = self.columns.split_at_mut(rank * n);
            let column = &mut rest[..n];
            let variance = cov[j * n + j];
            let mut pivot = variance;
            for before in done.chunks_exact(n) {
                pivot -= before[j] * before[j];
            }
            let floor = RELATIVE_PIVOT * variance + ABSOLUTE_PIVOT * mean[j] * mean[j];
            // Also where it is NaN: that shows in the innovation.
            if pivot.is_nan() || pivot <= floor {
                continue;
            }
            let inverse = 1.0 / pivot.sqrt();
            column[..j].fill(0.0);
            for i in j..n {
                let mut entry = cov[i * n + j];
                for before in done.chunks_exact(n) {
                    entry -= before[i] * before[j];
                }
                column[i] = entry * inverse;
            }
            self.pivots.push(j);
        }
    }

    /// A solution of P·x = b in place, for b in the range of P; components without a pivot become zero.
    pub fn solve(&self, b: &mut [f64]) {
        let n = b.len();
        let mut forward = [0.0; 64];
        let mut heap = vec![0.0; if self.rank() > 64 { self.rank() } else { 0 }];
        let z = if heap.is_empty() {
            &mut forward[..self.rank()]
        } else {
            &mut heap[..]
        };
        for (c, column) in self.columns(n).enumerate() {
            let pivot = self.pivots[c];
            z[c] = b[pivot] / column[pivot];
            for i in pivot..n {
                b[i] -= z[c] * column[i];
            }
        }
        b.fill(0.0);
        for (c, column) in self.columns(n).enumerate().rev() {
            let pivot = self.pivots[c];
            let known: f64 = (pivot + 1..n).map(|i| column[i] * b[i]).sum();
            b[pivot] = (z[c] - known) / column[pivot];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn product(root: &Root, n: usize) -> Vec<f64> {
        let mut all = vec![0.0; n * n];
        for column in root.columns(n) {
            for i in 0..n {
                for j in 0..n {
                    all[i * n + j] += column[i] * column[j];
                }
            }
        }
        all
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
        let mut root = Root::new(3);
        root.factor(3, &state);
        assert_eq!(root.rank(), 2);
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
