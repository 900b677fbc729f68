//! From features to parameters: the network, and what stands around it.

mod calibration;
mod quadratic;
mod scaler;
mod standardiser;

pub use calibration::{Calibration, INTERVAL_LEVEL, Spread};
pub use scaler::Scaler;
pub use standardiser::Standardiser;

use crate::network::{Network, NetworkError};
use ndarray::Array2;
use quadratic::Quadratic;
use std::sync::Arc;

/// Weight of a row of zeros in the ridge regression of the quadratic layer.
const RIDGE: f64 = 1.0;

/// Features → θ: standardised inputs z, a network, standardised targets, and, unless the settings say otherwise, a quadratic
/// layer beside the network's heads.
///
/// ```text
/// y = q(z) + α·r·network(z)         r: deviation of what q misses;  without a layer  y = network(z)
/// ```
#[derive(Debug, Clone)]
pub struct Readout {
    /// Features → network inputs.
    pub inputs: Standardiser,
    /// Targets ↔ θ.
    pub targets: Scaler,
    pub(in crate::estimator) layer: Option<Layer>,
    pub(in crate::estimator) network: Arc<dyn Network>,
}

/// The quadratic layer. The network learns its residuals: where q is nearly right, the network need not learn it anew.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    pub quadratic: Quadratic,
    /// r, for each target.
    pub residual: Vec<f64>,
    /// α, for each target.
    pub weight: Vec<f64>,
}

impl Readout {
    /// θ (rows: samples) from features, bounds not applied.
    pub fn predict(&self, features: &Array2<f64>) -> Result<Array2<f64>, NetworkError> {
        let z = self.inputs.apply(features);
        let said = self.network.predict(&z)?;
        let estimates = match &self.layer {
            Some(layer) => layer.join(&z, &said),
            None => said,
        };
        Ok(self.targets.invert(&estimates))
    }

    /// The network.
    pub fn network(&self) -> &Arc<dyn Network> {
        &self.network
    }
}

impl Layer {
    /// Fits inputs z to standardised targets; `None` where numbers are not finite.
    pub fn fit(z: &Array2<f64>, targets: &Array2<f64>) -> Option<Self> {
        let quadratic = Quadratic::fit(z, targets, RIDGE)?;
        Some(Self {
            residual: Scaler::fit(&(targets - &quadratic.predict(z))).scale,
            weight: vec![1.0; targets.ncols()],
            quadratic,
        })
    }

    /// y, of what the network says.
    fn join(&self, z: &Array2<f64>, said: &Array2<f64>) -> Array2<f64> {
        let mut estimates = self.quadratic.predict(z);
        for (mut row, said) in estimates.rows_mut().into_iter().zip(said.rows()) {
            for (j, value) in row.iter_mut().enumerate() {
                *value += self.weight[j] * self.residual[j] * said[j];
            }
        }
        estimates
    }

    /// Returns the residuals of q, in units r: the network's targets.
    pub fn rest(&self, z: &Array2<f64>, targets: &Array2<f64>) -> Array2<f64> {
        let mut rest = targets - &self.quadratic.predict(z);
        for mut row in rest.rows_mut() {
            for (value, unit) in row.iter_mut().zip(&self.residual) {
                *value /= unit;
            }
        }
        rest
    }

    /// Sets α by least squares on draws that the network never saw, within [0, 1]: where it has nothing to add, the
    /// quadratic map stays as it is.
    pub fn weigh(&mut self, rest: &Array2<f64>, said: &Array2<f64>) {
        for (j, weight) in self.weight.iter_mut().enumerate() {
            let (said, rest) = (said.column(j), rest.column(j));
            let alpha = said.dot(&rest) / said.dot(&said);
            *weight = if alpha.is_finite() {
                alpha.clamp(0.0, 1.0)
            } else {
                0.0
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// α is the share of what the network says that holds on draws it never saw.
    #[test]
    fn the_network_is_trusted_as_far_as_it_is_right() {
        let z = Array2::from_shape_fn((50, 1), |(i, _)| (i as f64 - 24.5) / 15.0);
        let mut layer = Layer::fit(&z, &z).unwrap();
        let rest = Array2::from_shape_fn((50, 1), |(i, _)| if i % 2 == 0 { 1.0 } else { -1.0 });
        for (said, expected) in [(2.0, 0.5), (0.5, 1.0), (-1.0, 0.0), (0.0, 0.0)] {
            layer.weigh(&rest, &(&rest * said));
            assert_eq!(layer.weight, [expected], "{said}");
        }
    }
}
