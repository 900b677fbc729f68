//! A black box with effects on its signals.

use super::finish::finish;
use super::{Slot, Slots};
use crate::effect::law::{Law, NoiseLaw};
use crate::record::{Drive, Signal, Signals};
use crate::twin::{DigitalTwin, KnownNoise, Noise, NoisePart, ParameterSpace, SimulationError};
use std::sync::Arc;

/// A simulator with effects before its inputs and after its outputs. These already contain its noise, unless that is known to come from
/// its sensors: then it enters where that of equations does.
pub(super) struct AugmentedBlackBox {
    base: Arc<dyn DigitalTwin>,
    slots: Slots,
}

impl AugmentedBlackBox {
    pub(super) fn new(base: Arc<dyn DigitalTwin>, slots: Slots) -> Self {
        Self { base, slots }
    }

    /// Outputs behind the laws of sensors, under a drive behind those of actuators, before what saturates or rounds readings; `None` where
    /// the simulator has noise of its own.
    fn before_readings(
        &self,
        theta: &[f64],
        drive: &Drive,
        acting: &Drive,
    ) -> Result<Option<KnownNoise>, SimulationError> {
        let own = &theta[..self.slots.base];
        let Some(mut known) = self.base.known_noise(own, acting)? else {
            return Ok(None);
        };
        for slot in self.slots.all.iter().filter(|slot| !slot.is_of_readings()) {
            match slot.effect.law() {
                Law::Sensor(law) => slot.pass(law.as_ref(), theta, drive, &mut known.mean),
                Law::MeasurementNoise(law) => known.parts.push(noise_of(slot, law.as_ref(), theta)),
                _ => {}
            }
        }
        Ok(Some(known))
    }
}

/// The noise that an effect adds to an output.
fn noise_of(slot: &Slot, law: &NoiseLaw, theta: &[f64]) -> NoisePart {
    let channel = slot.place.target;
    let source = format!("sensor-noise/{channel}");
    NoisePart::white(channel, law(slot.place.m(theta)), source)
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
        self.slots.check(theta, drive.dt())?;
        let actuated = self.slots.actuated(theta, drive)?;
        let acting = actuated.as_ref().unwrap_or(drive);
        let known = self.before_readings(theta, drive, acting)?;
        let is_known = known.is_some();
        let mut outputs = match known {
            Some(known) => known.draw(noise),
            None => (self.base).simulate(&theta[..self.slots.base], acting, noise)?,
        };
        // `all` is sorted along the signal: sensors, noise, saturation, rounding, outliers.
        for slot in (self.slots.all.iter()).filter(|slot| !is_known || slot.is_of_readings()) {
            match slot.effect.law() {
                Law::Sensor(law) => slot.pass(law.as_ref(), theta, drive, &mut outputs),
                Law::MeasurementNoise(law) => {
                    noise_of(slot, law.as_ref(), theta).add(noise, &mut outputs);
                }
                Law::Rounding(_) | Law::Outliers(_) => finish(slot, theta, noise, &mut outputs),
                _ => {}
            }
        }
        Ok(outputs)
    }

    fn known_noise(
        &self,
        theta: &[f64],
        drive: &Drive,
    ) -> Result<Option<KnownNoise>, SimulationError> {
        if self.slots.all.iter().any(Slot::is_of_readings) {
            return Ok(None);
        }
        self.slots.check(theta, drive.dt())?;
        let actuated = self.slots.actuated(theta, drive)?;
        self.before_readings(theta, drive, actuated.as_ref().unwrap_or(drive))
    }
}
