//! A state-space twin with effects, as a twin: its equations, and what lies outside of them.

use super::equations::AugmentedEquations;
use super::outliers::strike;
use crate::twin::{
    DigitalTwin, Drive, Law, Noise, ParameterSpace, Signal, SimulationError, StateSpace,
};

/// Equations with effects; magnitudes are checked before a run, outliers strike after it.
pub(super) struct AugmentedTwin(AugmentedEquations);

impl AugmentedTwin {
    pub(super) fn new(equations: AugmentedEquations) -> Self {
        Self(equations)
    }
}

impl DigitalTwin for AugmentedTwin {
    fn parameters(&self) -> ParameterSpace {
        self.0.parameters()
    }

    fn state_space(&self) -> Option<&dyn StateSpace> {
        Some(&self.0)
    }

    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        if theta.len() == self.0.parameters().len() {
            self.0.slots.check(theta, drive.dt())?;
        }
        let mut outputs = self.0.simulate(theta, drive, noise)?;
        for slot in self.0.slots.with(Law::Outliers) {
            strike(slot, theta, noise, &mut outputs);
        }
        Ok(outputs)
    }
}
