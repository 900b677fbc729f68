//! A black box with effects on its signals.

use super::outliers::strike;
use super::{Slot, Slots};
use crate::effect::law::{Instant, Law, SignalLaw};
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
fn pass(law: &SignalLaw, slot: &Slot, theta: &[f64], dt: f64, signal: &mut Signal) {
    let m = slot.place.m(theta);
    let mut channel = signal.column_mut(slot.place.target);
    // No filter pays for the states of a long register here.
    let mut memory = vec![channel[0]; slot.effect.kind().memories().1];
    for (k, value) in channel.iter_mut().enumerate() {
        let t = k as f64 * dt;
        *value = law(m, Instant { t, dt }, &mut memory, *value);
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
        for slot in &self.slots.all {
            if let Law::Actuator(law) = slot.effect.law() {
                pass(law.as_ref(), slot, theta, dt, &mut inputs);
            }
        }
        let drive = Drive::new(dt, inputs).map_err(|error| SimulationError::Fatal(error.into()))?;
        let mut outputs = self
            .base
            .simulate(&theta[..self.slots.base], &drive, noise)?;
        // `all` is sorted along the signal: sensors, noise, saturation, outliers.
        for slot in &self.slots.all {
            match slot.effect.law() {
                Law::Sensor(law) => pass(law.as_ref(), slot, theta, dt, &mut outputs),
                Law::MeasurementNoise(law) => {
                    let level = law(slot.place.m(theta));
                    let channel = slot.place.target;
                    let mut source = noise.source(&format!("sensor-noise/{channel}"));
                    for value in outputs.column_mut(channel) {
                        *value += level * source.normal();
                    }
                }
                Law::Outliers(_) => strike(slot, theta, noise, &mut outputs),
                _ => {}
            }
        }
        Ok(outputs)
    }
}
