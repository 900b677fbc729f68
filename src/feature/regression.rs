//! Least squares of a signal on its own past and that of other signals.

use super::{FeatureError, check_varies};
use crate::math::LeastSquares;
use crate::twin::Signal;
use nalgebra::DMatrix;

/// A signal and how many of its lags enter.
#[derive(Clone)]
pub(super) struct Lagged {
    pub values: Vec<f64>,
    pub lags: usize,
}

/// Coefficients of each output on its own last `p` values and the last `q` of each input:
///
/// ```text
/// y(t) = Σᵢ aᵢ·y(t − i) + Σⱼ Σᵢ bⱼᵢ·uⱼ(t − i) + e(t),   t = max(p, q) … N − 1
/// ```
///
/// in the order a₁ … a_p, b₁₁ … b₁_q, b₂₁ …, output after output.
pub(super) fn coefficients(
    inputs: &Signal,
    outputs: &Signal,
    p: usize,
    q: usize,
) -> Result<Vec<f64>, FeatureError> {
    // As many equations as unknowns.
    let (samples, needed) = (outputs.nrows(), p.max(q) + p + q * inputs.ncols());
    if samples < needed {
        return Err(FeatureError::TooShort { samples, needed });
    }
    check_varies(outputs)?;
    let inputs: Vec<Lagged> = (inputs.columns().into_iter())
        .map(|u| Lagged {
            values: u.to_vec(),
            lags: q,
        })
        .collect();
    let mut all = Vec::new();
    for y in outputs.columns() {
        let mut signals = vec![Lagged {
            values: y.to_vec(),
            lags: p,
        }];
        signals.extend(inputs.iter().cloned());
        all.extend(regress(&signals, p.max(q))?);
    }
    Ok(all)
}

/// Regresses the first signal on the lags of all, from sample `start` on.
fn regress(signals: &[Lagged], start: usize) -> Result<Vec<f64>, FeatureError> {
    let samples = signals[0].values.len();
    let columns: usize = signals.iter().map(|s| s.lags).sum();
    let rows = samples - start;
    let mut phi = DMatrix::zeros(rows, columns);
    let lagged = || {
        signals
            .iter()
            .flat_map(|s| (1..=s.lags).map(move |lag| (s, lag)))
    };
    for (mut column, (signal, lag)) in phi.column_iter_mut().zip(lagged()) {
        column.copy_from_slice(&signal.values[start - lag..start - lag + rows]);
    }
    let target = DMatrix::from_column_slice(rows, 1, &signals[0].values[start..]);
    let gram = lagged_gram(&phi, signals, start);
    let fit = LeastSquares::with_gram(&phi, &gram)?.solve(&target)?;
    Ok(fit.coefficients.as_slice().to_vec())
}

/// ΦᵀΦ of lagged signals (lower triangle), in O(n²) beyond the first row of each block: moving both lags by one
/// drops one product and adds one.
fn lagged_gram(phi: &DMatrix<f64>, signals: &[Lagged], start: usize) -> DMatrix<f64> {
    let (rows, columns) = phi.shape();
    let mut gram = DMatrix::zeros(columns, columns);
    let mut first_row = 0;
    for (a, left) in signals.iter().enumerate() {
        let mut first_column = 0;
        for right in &signals[..=a] {
            for i in 0..left.lags {
                for j in 0..right.lags {
                    let (row, column) = (first_row + i, first_column + j);
                    if row < column {
                        continue;
                    }
                    gram[(row, column)] = if i == 0 || j == 0 {
                        phi.column(row).dot(&phi.column(column))
                    } else {
                        let (old, new) = (start + rows - 1, start - 1);
                        gram[(row - 1, column - 1)] + left.values[new - i] * right.values[new - j]
                            - left.values[old - i] * right.values[old - j]
                    };
                }
            }
            first_column += right.lags;
        }
        first_row += left.lags;
    }
    gram
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Noise;

    fn random(name: &str, n: usize) -> Vec<f64> {
        let mut source = Noise::new(1, "test", 0).source(name);
        (0..n).map(|_| source.normal()).collect()
    }

    #[test]
    fn the_fast_gram_matrix_is_the_gram_matrix() {
        let signals = [("y", 5), ("u1", 3), ("u2", 4)].map(|(name, lags)| Lagged {
            values: random(name, 60),
            lags,
        });
        let start = 5;
        let phi = DMatrix::from_fn(55, 12, |t, c| {
            let (s, lag) = match c {
                0..5 => (0, c + 1),
                5..8 => (1, c - 4),
                _ => (2, c - 7),
            };
            signals[s].values[start + t - lag]
        });
        let fast = lagged_gram(&phi, &signals, start);
        let exact = phi.transpose() * &phi;
        for i in 0..12 {
            for j in 0..=i {
                assert!((fast[(i, j)] - exact[(i, j)]).abs() < 1e-12);
            }
        }
    }

    /// An input held for long makes its lags nearly equal: coefficients stay bounded, predictions right.
    #[test]
    fn a_held_input_is_no_problem() {
        let u: Vec<f64> = (0..200)
            .map(|k| if k < 100 { 1.0 } else { 1.0 + 1e-14 })
            .collect();
        let mut y = vec![0.0; 200];
        for k in 1..200 {
            y[k] = 0.9 * y[k - 1] + 0.5 * u[k - 1];
        }
        let signal = |v: &[f64]| Signal::from_shape_vec((v.len(), 1), v.to_vec()).unwrap();
        let found = coefficients(&signal(&u), &signal(&y), 1, 30).unwrap();
        assert!((found[0] - 0.9).abs() < 1e-6, "{}", found[0]);
        let gain: f64 = found[1..].iter().sum();
        assert!((gain - 0.5).abs() < 1e-5, "{gain}");
        assert!(found.iter().all(|v| v.abs() < 2.0));
    }
}
