//! Least squares of a signal on its own past and that of other signals.

use super::{FeatureError, check_varies};
use crate::math::{Fit, Lagged, LaggedSignals, LeastSquares, MathError, one_column};
use crate::record::Signal;

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
    // As many equations as unknowns; a file may ask for any order.
    let unknowns = p.saturating_add(q.saturating_mul(inputs.ncols()));
    let (samples, needed) = (outputs.nrows(), p.max(q).saturating_add(unknowns));
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
        all.extend_from_slice(regress(signals, p.max(q))?.coefficients.as_slice());
    }
    Ok(all)
}

/// Regresses the first signal on the lags of all, from sample `start` on.
pub(super) fn regress(signals: Vec<Lagged>, start: usize) -> Result<Fit, MathError> {
    let target = one_column(&signals[0].values[start..]);
    let phi = LaggedSignals::new(signals, start);
    LeastSquares::with_gram(&phi, &phi.gram())?.solve(&target)
}

#[cfg(test)]
mod tests {
    use super::*;

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
