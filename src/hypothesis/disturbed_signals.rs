//! Disturbances of a black box's signals: what stands for an effect that nobody listed.

use super::entry::{Entry, share, started};
use crate::record::{Drive, Signal, Signals};
use crate::twin::{
    DigitalTwin, KnownNoise, Noise, NoisePart, Parameter, ParameterSpace, Role, SimulationError,
    Twin,
};
use std::sync::Arc;

/// The twin with an Ornstein–Uhlenbeck disturbance on an output or an input, θ longer by its strength σ.
///
/// ```text
/// d ← a·d + σ·√(1 − a²)·w        (a = 1: d ← d + σ·w)        y_j + d   or   u_j + d
/// d ~ N(0, σ²) at the start      (a = 1: 0)
/// ```
pub(crate) fn disturbed(base: Arc<dyn DigitalTwin>, entry: Entry, memory: f64) -> Twin {
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
    /// The disturbance of strength σ on a channel.
    fn on(&self, channel: usize, sigma: f64) -> NoisePart {
        NoisePart {
            output: channel,
            level: share(self.memory) * sigma,
            memory: Some(self.memory),
            start: started(self.memory) * sigma,
            source: "disturbance".to_owned(),
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
            self.on(j, sigma[0]).add(noise, &mut inputs);
            let drive = drive
                .with_inputs(inputs)
                .map_err(|_| SimulationError::Diverged { at: 0.0 })?;
            return self.base.simulate(own, &drive, noise);
        }
        let mut outputs = self.base.simulate(own, drive, noise)?;
        if let Entry::Sensor(j) = self.entry {
            self.on(j, sigma[0]).add(noise, &mut outputs);
        }
        Ok(outputs)
    }
    fn known_noise(
        &self,
        theta: &[f64],
        drive: &Drive,
    ) -> Result<Option<KnownNoise>, SimulationError> {
        let Entry::Sensor(output) = self.entry else {
            return Ok(None);
        };
        let (own, sigma) = theta.split_at(theta.len() - 1);
        let mut known = self.base.known_noise(own, drive)?;
        if let Some(known) = &mut known {
            known.parts.push(self.on(output, sigma[0]));
        }
        Ok(known)
    }
}
