//! Least squares of a signal on its own past and that of other signals.

use super::{FeatureError, FeatureMap, check_long, check_varies};
use crate::math::{Lagged, LaggedSignals, LeastSquares, MathError, Regression, one_column};
use crate::record::{Drive, Signal};

/// Coefficients of each output on its own last p values and the last q of each input:
///
/// ```text
/// y(t) = Σᵢ aᵢ·y(t − i) + Σⱼ Σᵢ bⱼᵢ·uⱼ(t − i) + e(t),   t = max(p, q) … N − 1
/// ```
///
/// in the order a₁ … a_p, b₁₁ … b₁_q, b₂₁ …, output after output.
pub(super) struct RegressionMap {
    pub p: usize,
    pub q: usize,
    /// Inputs that enter; none where q = 0.
    pub inputs: usize,
    pub outputs: usize,
}

impl FeatureMap for RegressionMap {
    fn dim(&self) -> usize {
        self.outputs * (self.p + self.q * self.inputs)
    }

    fn extract(&self, drive: &Drive, outputs: &Signal) -> Result<Vec<f64>, FeatureError> {
        // As many equations as unknowns; a file may ask for any order.
        let start = self.p.max(self.q);
        let unknowns = (self.q.saturating_mul(self.inputs)).saturating_add(self.p);
        check_long(outputs.nrows(), start.saturating_add(unknowns))?;
        check_varies(outputs)?;
        let inputs = drive.inputs().columns().into_iter().take(self.inputs);
        let inputs: Vec<Lagged> = inputs.map(|u| Lagged::new(u.to_vec(), self.q)).collect();
        let mut all = Vec::new();
        for y in outputs.columns() {
            let mut signals = vec![Lagged::new(y.to_vec(), self.p)];
            signals.extend(inputs.iter().cloned());
            all.extend_from_slice(regress(signals, start)?.coefficients.as_slice());
        }
        Ok(all)
    }
}

/// Regresses the first signal on the lags of all, from sample `start` on.
pub(super) fn regress(signals: Vec<Lagged>, start: usize) -> Result<Regression, MathError> {
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
        let map = RegressionMap {
            p: 1,
            q: 30,
            inputs: 1,
            outputs: 1,
        };
        let drive = Drive::new(1.0, signal(&u)).unwrap();
        let found = map.extract(&drive, &signal(&y)).unwrap();
        assert!((found[0] - 0.9).abs() < 1e-6, "{}", found[0]);
        let gain: f64 = found[1..].iter().sum();
        assert!((gain - 0.5).abs() < 1e-5, "{gain}");
        assert!(found.iter().all(|v| v.abs() < 2.0));
    }
}
