//! A black box with effects on its signals.

use super::outliers::strike;
use super::{Slot, Slots};
use crate::effect::{Instant, Law};
use crate::record::{Drive, Signal, Signals};
use crate::twin::{DigitalTwin, Noise, ParameterSpace, SimulationError};
use std::sync::Arc;

/// A simulator with effects before its inputs and after its outputs, which already contain its noise.
pub(super) struct AugmentedBlackBox {
    base: Arc<dyn DigitalTwin>,
    slots: Slots,
}

impl AugmentedBlackBox {
    pub(super) fn new(base: Arc<dyn DigitalTwin>, slots: Slots) -> Self {
        Self { base, slots }
    }
}

/// Passes one channel of a whole signal through an effect.
fn pass(slot: &Slot, theta: &[f64], dt: f64, signal: &mut Signal) {
    let m = slot.m(theta);
    let mut memory = vec![0.0; slot.effect.memory()];
    let mut channel = signal.column_mut(slot.target);
    slot.effect.begin(m, &mut memory, channel[0]);
    for (k, value) in channel.iter_mut().enumerate() {
        let instant = Instant {
            t: k as f64 * dt,
            dt,
        };
        *value = slot.effect.signal(m, instant, &mut memory, *value);
    }
}

impl DigitalTwin for AugmentedBlackBox {
    fn parameters(&self) -> ParameterSpace {
        self.slots.space(&self.base.parameters())
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
        let dt = drive.dt();
        self.slots.check(theta, dt)?;
        let mut inputs = drive.inputs().clone();
        for slot in self.slots.with(Law::Actuator) {
            pass(slot, theta, dt, &mut inputs);
        }
        let drive = Drive::new(dt, inputs).map_err(|error| SimulationError::Fatal(error.into()))?;
        let mut outputs = self
            .base
            .simulate(&theta[..self.slots.base], &drive, noise)?;
        // `all` is sorted along the signal: sensors, noise, saturation, outliers.
        for slot in &self.slots.all {
            match slot.effect.law() {
                Law::Sensor => pass(slot, theta, dt, &mut outputs),
                Law::MeasurementNoise => {
                    let level = slot.effect.noise_level(slot.m(theta));
                    let mut source = noise.source(&format!("sensor-noise/{}", slot.target));
                    for value in outputs.column_mut(slot.target) {
                        *value += level * source.normal();
                    }
                }
                Law::Outliers => strike(slot, theta, noise, &mut outputs),
                _ => {}
            }
        }
        Ok(outputs)
    }
}
