//! Autoregressive coefficients with inputs.

use super::regression::RegressionMap;
use super::{FeatureError, FeatureMap, FeatureRecipe};
use crate::twin::Twin;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

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

#[cfg(test)]
mod tests {
    use super::*;
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
