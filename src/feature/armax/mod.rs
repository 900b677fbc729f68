//! Coefficients of ARMAX models.

mod hannan_rissanen;

use super::{FeatureError, FeatureMap, FeatureRecipe, check_long, check_varies};
use crate::record::{Drive, Signal};
use crate::twin::Twin;
use hannan_rissanen::{ArmaxModel, Orders, estimate};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// ARMAX(p, q, r): a model of each output with coloured noise,
///
/// ```text
/// y(t) = Σᵢ aᵢ·y(t − i) + Σⱼ Σᵢ bⱼᵢ·uⱼ(t − i) + e(t) + Σᵢ cᵢ·e(t − i);
/// features a₁ … a_p, b₁₁ … b₁_q, b₂₁ …, c₁ … c_r, log std e,   output after output
/// ```
///
/// For twins whose noise is coloured: sensor noise on top of a noisy state is enough, and AR or ARX coefficients then need
/// many lags to say what few say here. p, r ≥ 1; with q = 0, as for twins without inputs, the model is ARMA(p, r).
/// a and c have no unit, b those of y/u, log std e that of log y: it is the only feature here that sees how strong the
/// noise is. No decision depends on the data, so features are smooth in them, but for zeros of A and C that
/// nearly cancel; choose orders as low as the system's.
///
/// Estimated by Hannan and Rissanen's regressions (a long ARX model, whose residuals are then regressors) and six
/// Gauss–Newton refinements on regressors filtered by 1/C, in the manner of Kavalieris; zeros of C are held within 0.98.
/// A record of 300 to 400 samples takes 0.1 to 0.3 ms, many times as long as ARX of these orders.
///
/// File: `{ kind = "armax", outputs = 2, inputs = 2, noise = 2 }`.
///
/// Source: Hannan & Rissanen, "Recursive estimation of mixed autoregressive-moving average order", *Biometrika* 69, 1982;
/// Hannan & Kavalieris, "A method for autoregressive-moving average estimation", *Biometrika* 71, 1984; Ljung, *System
/// Identification*, 2nd ed., chapter 10.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Armax {
    /// p ≥ 1: lags of each output.
    pub outputs: usize,
    /// q ≥ 0: lags of each input; none unless given.
    #[serde(default)]
    pub inputs: usize,
    /// r ≥ 1: lags of the noise.
    pub noise: usize,
}

#[typetag::serde(name = "armax")]
impl FeatureRecipe for Armax {
    fn bind(&self, twin: &Twin) -> Result<Arc<dyn FeatureMap>, FeatureError> {
        let refuse = |problem| Err(FeatureError::setting("armax", problem));
        let Self {
            outputs: p,
            inputs: q,
            noise: r,
        } = *self;
        if p == 0 || r == 0 {
            return refuse(format!(
                "outputs = {p}, noise = {r}; both orders are at least 1, without noise take kind = \"arx\" or \"ar\""
            ));
        }
        let signals = twin.signals();
        if q > 0 && signals.inputs.is_empty() {
            return refuse(format!(
                "inputs = {q}, but the twin has no input; take inputs = 0"
            ));
        }
        let inputs = if q > 0 { signals.inputs.len() } else { 0 };
        Ok(Arc::new(ArmaxMap {
            orders: Orders { p, q, r, inputs },
            outputs: signals.outputs.len(),
        }))
    }
}

struct ArmaxMap {
    orders: Orders,
    outputs: usize,
}

impl FeatureMap for ArmaxMap {
    fn dim(&self) -> usize {
        self.outputs * (self.orders.coefficients() + 1)
    }

    fn extract(&self, drive: &Drive, outputs: &Signal) -> Result<Vec<f64>, FeatureError> {
        check_long(outputs.nrows(), self.orders.needed())?;
        check_varies(outputs)?;
        let inputs: Vec<Vec<f64>> = (drive.inputs().columns().into_iter())
            .take(self.orders.inputs)
            .map(|u| u.to_vec())
            .collect();
        let mut features = Vec::with_capacity(self.dim());
        for y in outputs.columns() {
            let ArmaxModel {
                coefficients,
                innovation,
            } = estimate(&y.to_vec(), &inputs, self.orders)?;
            features.extend(coefficients);
            features.push(innovation.ln());
        }
        Ok(features)
    }
}

#[cfg(test)]
mod tests;
