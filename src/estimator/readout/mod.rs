//! From features to parameters: the network, and what stands around it.

mod calibration;
mod layer;
mod scaling;

pub use calibration::{Calibration, INTERVAL_LEVEL, Spread};
pub use layer::QuadraticLayer;
pub use scaling::{Scaler, Standardiser};

use crate::network::{Network, NetworkError};
use ndarray::Array2;
use std::sync::Arc;

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
    pub(in crate::estimator) layer: Option<QuadraticLayer>,
    pub(in crate::estimator) network: Arc<dyn Network>,
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
