//! Disturbances of a black box's signals: what stands for an effect that nobody listed.

use crate::evid::hypotheses::entry::{Entry, share};
use crate::record::{Drive, Signal, Signals};
use crate::twin::{DigitalTwin, Noise, Parameter, ParameterSpace, Role, SimulationError, Twin};
use std::sync::Arc;

/// The twin with an Ornstein–Uhlenbeck disturbance on an output or an input, θ longer by its strength σ.
///
/// ```text
/// d ← a·d + σ·√(1 − a²)·w        (a = 1: d ← d + σ·w),   d = 0 at the start        y_j + d   or   u_j + d
/// ```
pub(in crate::evid) fn disturbed(
    base: Arc<dyn DigitalTwin>,
    entry: Entry,
    memory: f64,
) -> Twin {
    Twin::BlackBox(Arc::new(Disturbed {
        base,
        entry,
        memory,
    }))
}

struct Disturbed {
    base: Arc<dyn DigitalTwin>,
    entry: Entry,
    memory: f64,
}

impl Disturbed {
    fn add(&self, sigma: f64, noise: Noise, column: usize, signal: &mut Signal) {
        let mut source = noise.source("disturbance");
        let share = share(self.memory);
        let mut d = 0.0;
        for value in signal.column_mut(column) {
            *value += d;
            d = self.memory * d + share * sigma * source.normal();
        }
    }
}

impl DigitalTwin for Disturbed {
    fn parameters(&self) -> ParameterSpace {
        let sigma = Parameter::new("disturbance", "", 0.01, 1.0).with_role(Role::Magnitude);
        ParameterSpace::new(self.base.parameters().iter().cloned().chain([sigma]))
    }
    fn signals(&self) -> Signals {
        self.base.signals()
    }
    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        let (own, sigma) = theta.split_at(theta.len() - 1);
        if let Entry::Actuator(j) = self.entry {
            let mut inputs = drive.inputs().clone();
            self.add(sigma[0], noise, j, &mut inputs);
            let drive = drive
                .with_inputs(inputs)
                .map_err(|_| SimulationError::Diverged { at: 0.0 })?;
            return self.base.simulate(own, &drive, noise);
        }
        let mut outputs = self.base.simulate(own, drive, noise)?;
        if let Entry::Sensor(j) = self.entry {
            self.add(sigma[0], noise, j, &mut outputs);
        }
        Ok(outputs)
    }
}
