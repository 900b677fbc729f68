//! Autoregressive coefficients, with and without inputs.

use super::{FeatureError, FeatureMap, FeatureRecipe, check_long, check_varies};
use crate::math::{Lagged, LaggedSignals, LeastSquares, MathError, Regression};
use crate::record::{Drive, Signal};
use crate::twin::Twin;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// AR(p): the least-squares coefficients of each output on its own last p values,
///
/// ```text
/// y(t) = Σᵢ aᵢ·y(t − i) + e(t);   features a₁ … a_p, output after output
/// ```
///
/// For twins without input. File: `{ kind = "ar", order = 5 }`.
///
/// Source: Lakshminarayanan, Guerrero & Rojas, section V (AR(5) for the van der Pol oscillator).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ar {
    /// p ≥ 1.
    pub order: usize,
}

#[typetag::serde(name = "ar")]
impl FeatureRecipe for Ar {
    fn bind(&self, twin: &Twin) -> Result<Arc<dyn FeatureMap>, FeatureError> {
        if self.order == 0 {
            let problem = "order = 0; an order is at least 1";
            return Err(FeatureError::setting("ar", problem));
        }
        Ok(Arc::new(RegressionMap {
            p: self.order,
            q: 0,
            inputs: 0,
            outputs: twin.signals().outputs.len(),
        }))
    }
}

/// ARX(p, q): the least-squares coefficients of each output on its own last p values and the last q of each input,
///
/// ```text
/// y(t) = Σᵢ aᵢ·y(t − i) + Σⱼ Σᵢ bⱼᵢ·uⱼ(t − i) + e(t);   features a₁ … a_p, b₁₁ … b₁_q, …
/// ```
///
/// File: `{ kind = "arx", outputs = 64, inputs = 64 }`.
///
/// Source: Lakshminarayanan, Guerrero & Rojas, section V (ARX(64, 64) for the tanks).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Arx {
    /// p ≥ 1: lags of each output.
    pub outputs: usize,
    /// q ≥ 1: lags of each input.
    pub inputs: usize,
}

#[typetag::serde(name = "arx")]
impl FeatureRecipe for Arx {
    fn bind(&self, twin: &Twin) -> Result<Arc<dyn FeatureMap>, FeatureError> {
        let Self {
            outputs: p,
            inputs: q,
        } = *self;
        if p == 0 || q == 0 {
            let problem = format!("outputs = {p}, inputs = {q}; both orders are at least 1");
            return Err(FeatureError::setting("arx", problem));
        }
        let signals = twin.signals();
        if signals.inputs.is_empty() {
            let problem = "the twin has no input; take kind = \"ar\"";
            return Err(FeatureError::setting("arx", problem));
        }
        Ok(Arc::new(RegressionMap {
            p,
            q,
            inputs: signals.inputs.len(),
            outputs: signals.outputs.len(),
        }))
    }
}

/// Coefficients of each output on its own last p values and the last q of each input:
///
/// ```text
/// y(t) = Σᵢ aᵢ·y(t − i) + Σⱼ Σᵢ bⱼᵢ·uⱼ(t − i) + e(t),   t = max(p, q) … N − 1
/// ```
///
/// in the order a₁ … a_p, b₁₁ … b₁_q, b₂₁ …, output after output.
struct RegressionMap {
    p: usize,
    q: usize,
    /// Inputs that enter; none where q = 0.
    inputs: usize,
    outputs: usize,
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
            all.extend(regress(signals, start)?.coefficients);
        }
        Ok(all)
    }
}

/// Regresses the first signal on the lags of all, from sample `start` on.
pub(super) fn regress(signals: Vec<Lagged>, start: usize) -> Result<Regression, MathError> {
    let target = signals[0].values[start..].to_vec();
    let phi = LaggedSignals::new(signals, start);
    LeastSquares::with_gram(&phi, &phi.gram())?.solve(&target)
}

#[cfg(test)]
mod tests {
    mod without_inputs {
        use super::super::*;
        use crate::feature::testing::tank;
        use crate::record::{Drive, Signal};

        fn features(order: usize, y: &[f64]) -> Result<Vec<f64>, FeatureError> {
            let twin = Twin::new(tank(0));
            let outputs = Signal::from_shape_vec((y.len(), 1), y.to_vec()).unwrap();
            let drive = Drive::autonomous(1.0, y.len()).unwrap();
            Ar { order }.bind(&twin)?.extract(&drive, &outputs)
        }

        /// AR(1) in closed form: a = Σ y(t)y(t−1) / Σ y(t−1)².
        #[test]
        fn first_order_in_closed_form() {
            let y = [1.0, -0.5, 2.0, 0.3, 0.7];
            let above: f64 = (1..5).map(|t| y[t] * y[t - 1]).sum();
            let below: f64 = (1..5).map(|t| y[t - 1] * y[t - 1]).sum();
            assert!((features(1, &y).unwrap()[0] - above / below).abs() < 1e-14);
        }

        /// cos ωt obeys y(t) = 2·cos ω·y(t−1) − y(t−2) exactly.
        #[test]
        fn a_sinusoid_is_second_order() {
            let omega = 0.3f64;
            let y: Vec<f64> = (0..80).map(|t| (omega * f64::from(t)).cos()).collect();
            let a = features(2, &y).unwrap();
            assert!(
                (a[0] - 2.0 * omega.cos()).abs() < 1e-9 && (a[1] + 1.0).abs() < 1e-9,
                "{a:?}"
            );
        }

        #[test]
        fn what_cannot_be_fitted_is_named() {
            let short = features(4, &[1.0, 2.0, 3.0, 1.0, 2.0])
                .unwrap_err()
                .to_string();
            assert!(
                short.contains("5 samples") && short.contains("need 8"),
                "{short}"
            );
            let flat = features(1, &[3.0; 9]).unwrap_err().to_string();
            assert!(flat.contains("output 1 is constant (3)"), "{flat}");
            assert!(features(0, &[1.0; 9]).is_err());
        }
    }

    mod with_inputs {
        use super::super::*;
        use crate::record::{Drive, Quantity, Signal};
        use crate::twin::{Noise, Now, Outline, Parameter, ParameterSpace, StateSpace};

        /// Two inputs and two outputs: y₁ ← 0.7·y₁ + u₁ − 2·u₂, y₂ ← 0.2·y₂ + 3·u₁.
        struct Linear;
        impl StateSpace for Linear {
            fn outline(&self) -> Outline {
                let named = |names: [&str; 2]| names.map(|n| Quantity::new(n, "")).to_vec();
                Outline {
                    parameters: ParameterSpace::new([Parameter::new("a", "", 0.0, 1.0)]),
                    states: named(["x1", "x2"]),
                    inputs: named(["u1", "u2"]),
                    outputs: named(["y1", "y2"]),
                    ..Outline::new()
                }
            }
            fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
                dx[0] = (now.theta[0] - 1.0) * x[0] + now.u[0] - 2.0 * now.u[1];
                dx[1] = -0.8 * x[1] + 3.0 * now.u[0];
            }
            fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
                y.copy_from_slice(x);
            }
        }

        #[test]
        fn several_channels_come_output_after_output() {
            let twin = Twin::new(Linear);
            let mut source = Noise::new(1, "test", 0).source("u");
            let inputs = Signal::from_shape_simple_fn((50, 2), || source.normal());
            let drive = Drive::new(1.0, inputs).unwrap();
            let map = Arx {
                outputs: 1,
                inputs: 1,
            };
            let map = map.bind(&twin).unwrap();
            let y = twin.simulate(&[0.7], &drive, Noise::OFF).unwrap();
            let found = map.extract(&drive, &y).unwrap();
            let exact = [0.7, 1.0, -2.0, 0.2, 3.0, 0.0];
            assert_eq!(map.dim(), 6);
            assert!(
                found.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-9),
                "{found:?}"
            );
        }
    }

    mod map {
        use super::super::*;

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
}
