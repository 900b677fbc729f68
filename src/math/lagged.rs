//! Regressors made of the past of signals.

use super::Regressors;
use super::widest::widest;
use nalgebra::DMatrix;

/// A signal and how many of its lags are regressors.
#[derive(Debug, Clone, PartialEq)]
pub struct Lagged {
    /// Samples, in any unit.
    pub values: Vec<f64>,
    /// Lags 1 … `lags`.
    pub lags: usize,
}

impl Lagged {
    /// A signal with this many lags.
    pub fn new(values: Vec<f64>, lags: usize) -> Self {
        Self { values, lags }
    }
}

/// The matrix Φ whose columns are lags of signals, never written out:
///
/// ```text
/// Φ[t, (s, i)] = x_s[start + t − i],   i = 1 … lags of s,   t = 0 … N − start − 1
/// ```
///
/// Columns come signal after signal. A product with Φ or Φᵀ is a correlation over samples that stay in the processor's
/// nearest cache, and ΦᵀΦ costs O(n²) beyond the first column of each signal, since moving both lags by one drops one
/// product and adds one. For 336 × 128: 1.5 µs a product, 7 µs for ΦᵀΦ.
#[derive(Debug, Clone)]
pub struct LaggedSignals {
    signals: Vec<Lagged>,
    start: usize,
    rows: usize,
}

impl LaggedSignals {
    /// Lags of `signals`, all of one length, from sample `start` on, which is at least the largest number of lags.
    pub fn new(mut signals: Vec<Lagged>, start: usize) -> Self {
        signals.retain(|s| s.lags > 0);
        let samples = signals.first().map_or(start, |s| s.values.len());
        assert!(
            (signals.iter()).all(|s| s.values.len() == samples && s.lags <= start),
            "signals have one length and at most `start` lags"
        );
        assert!(start <= samples, "`start` is within the signals");
        Self {
            signals,
            start,
            rows: samples - start,
        }
    }

    /// ΦᵀΦ, its lower triangle; what stands above is zero.
    pub fn gram(&self) -> DMatrix<f64> {
        let (rows, n) = self.shape();
        let mut gram = DMatrix::zeros(n, n);
        // Φᵀ times the first column of each signal.
        let first: Vec<Vec<f64>> = (self.signals.iter())
            .map(|s| {
                let mut products = vec![0.0; n];
                self.transposed(&s.values[self.start - 1..][..rows], &mut products);
                products
            })
            .collect();
        // What enters the sums, and what leaves them, where a lag grows to 2, 3, …
        let backwards = |from: usize| -> Vec<Vec<f64>> {
            (self.signals.iter())
                .map(|s| (s.values[from - s.lags..from].iter().rev().copied()).collect())
                .collect()
        };
        let (entering, leaving) = (backwards(self.start), backwards(self.start + rows));
        let mut first_column = 0;
        for (b, right) in self.signals.iter().enumerate() {
            for j in 0..right.lags {
                let column = first_column + j;
                let (before, here) = gram.as_mut_slice().split_at_mut(column * n);
                let mut row = first_column;
                for (a, left) in self.signals.iter().enumerate().skip(b) {
                    let block = &mut here[row..row + left.lags];
                    if j == 0 {
                        block.copy_from_slice(&first[b][row..row + left.lags]);
                    } else {
                        if a > b {
                            block[0] = first[a][column];
                        }
                        let from = if a > b { 1 } else { j };
                        let known = &before[(column - 1) * n + row + from - 1..];
                        let (e, l) = (entering[b][j], leaving[b][j]);
                        let terms = entering[a][from..].iter().zip(&leaving[a][from..]);
                        for ((new, known), (enters, leaves)) in
                            block[from..].iter_mut().zip(known).zip(terms)
                        {
                            *new = known + enters * e - leaves * l;
                        }
                    }
                    row += left.lags;
                }
            }
            first_column += right.lags;
        }
        gram
    }
}

impl Regressors for LaggedSignals {
    fn shape(&self) -> (usize, usize) {
        (self.rows, self.signals.iter().map(|s| s.lags).sum())
    }

    fn times(&self, beta: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        let mut rest = beta;
        for s in &self.signals {
            let (mine, others) = rest.split_at(s.lags);
            let backwards: Vec<f64> = mine.iter().rev().copied().collect();
            correlate(&backwards, &s.values[self.start - s.lags..], out);
            rest = others;
        }
    }

    fn transposed(&self, r: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        let mut rest = out;
        for s in &self.signals {
            let (mine, others) = rest.split_at_mut(s.lags);
            correlate(r, &s.values[self.start - s.lags..], mine);
            mine.reverse();
            rest = others;
        }
    }
}

/// out_k ← out_k + Σ_j c_j·x_{j+k}; each sum runs in the order of j, whatever the width of vectors.
fn correlate(c: &[f64], x: &[f64], out: &mut [f64]) {
    widest(
        #[inline(always)]
        || correlate_all(c, x, out),
    );
}

/// [`correlate`] for one width of vectors.
#[inline(always)]
fn correlate_all(c: &[f64], mut x: &[f64], out: &mut [f64]) {
    let (wide, rest) = out.as_chunks_mut::<32>();
    for sums in wide {
        correlate_block(c, x, sums);
        x = &x[32..];
    }
    let (narrow, rest) = rest.as_chunks_mut::<8>();
    for sums in narrow {
        correlate_block(c, x, sums);
        x = &x[8..];
    }
    for sum in rest.as_chunks_mut::<1>().0 {
        correlate_block(c, x, sum);
        x = &x[1..];
    }
}

/// [`correlate`] for a number of sums that fits the registers.
#[inline(always)]
fn correlate_block<const W: usize>(c: &[f64], x: &[f64], out: &mut [f64; W]) {
    let mut sums = [0.0; W];
    for (c, x) in c.iter().zip(x.array_windows::<W>()) {
        for (sum, x) in sums.iter_mut().zip(x) {
            *sum += c * x;
        }
    }
    for (out, sum) in out.iter_mut().zip(sums) {
        *out += sum;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn random(n: usize, seed: u64) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..n).map(|_| rng.gen_range(-1.0..1.0)).collect()
    }

    /// Every block length and its rests; one signal without lags.
    #[test]
    fn products_are_those_of_the_written_matrix() {
        let lags = [45, 0, 3, 12];
        let signals: Vec<_> = (lags.iter().zip(0..))
            .map(|(&lags, seed)| Lagged {
                values: random(150, seed),
                lags,
            })
            .collect();
        let start = 47;
        let columns: Vec<(usize, usize)> = (lags.iter().enumerate())
            .flat_map(|(s, &lags)| (1..=lags).map(move |lag| (s, lag)))
            .collect();
        let written = DMatrix::from_fn(150 - start, columns.len(), |t, c| {
            signals[columns[c].0].values[start + t - columns[c].1]
        });
        let phi = LaggedSignals::new(signals, start);
        assert_eq!(phi.shape(), written.shape());
        let (rows, n) = phi.shape();
        let (beta, r) = (random(n, 10), random(rows, 11));
        let (mut fast, mut plain) = (vec![1.0; rows], vec![2.0; rows]);
        phi.times(&beta, &mut fast);
        written.times(&beta, &mut plain);
        assert!(fast.iter().zip(&plain).all(|(a, b)| (a - b).abs() < 1e-12));
        let (mut fast, mut plain) = (vec![1.0; n], vec![2.0; n]);
        phi.transposed(&r, &mut fast);
        written.transposed(&r, &mut plain);
        assert!(fast.iter().zip(&plain).all(|(a, b)| (a - b).abs() < 1e-12));
        let difference = phi.gram() - (written.transpose() * &written).lower_triangle();
        assert!(difference.amax() < 1e-12);
    }
}
