//! A black box for tests.

use super::{DigitalTwin, Noise, Parameter, ParameterSpace, SimulationError};
use crate::record::{Drive, Signal};

/// y = f(θ, u) at once, without noise; parameters `a` and `b`, of which it has D.
pub(crate) struct AtOnce<const D: usize>(pub fn(&[f64], f64) -> f64);

impl<const D: usize> DigitalTwin for AtOnce<D> {
    fn parameters(&self) -> ParameterSpace {
        let names = ["a", "b"].into_iter().take(D);
        ParameterSpace::new(names.map(|name| Parameter::new(name, "", 0.5, 2.0)))
    }

    fn simulate(&self, theta: &[f64], drive: &Drive, _: Noise) -> Result<Signal, SimulationError> {
        Ok(Signal::from_shape_fn((drive.samples(), 1), |(k, _)| {
            self.0(theta, drive.input(k).first().copied().unwrap_or(0.0))
        }))
    }
}
