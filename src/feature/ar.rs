//! Autoregressive coefficients.

use super::regression::RegressionMap;
use super::{FeatureError, FeatureMap, FeatureRecipe};
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::feature::testing::Tank;
    use crate::record::{Drive, Signal};

    fn features(order: usize, y: &[f64]) -> Result<Vec<f64>, FeatureError> {
        let twin = Twin::new(Tank(0));
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
