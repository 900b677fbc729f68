//! A black box with effects on its signals.

use super::finish::finish;
use super::{Slot, Slots};
use crate::effect::law::Law;
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

    /// Outputs with their noise before what saturates or rounds readings; `None` where the simulator has noise of its own.
    fn before_readings(
        &self,
        theta: &[f64],
        drive: &Drive,
    ) -> Result<Option<KnownNoise>, SimulationError> {
        self.slots.check(theta, drive.dt())?;
        let actuated = self.slots.actuated(theta, drive)?;
        let acting = actuated.as_ref().unwrap_or(drive);
        let own = &theta[..self.slots.base];
        let Some(mut known) = self.base.known_noise(own, acting)? else {
            return Ok(None);
        };
        for slot in self.slots.all.iter().filter(|slot| !slot.is_of_readings()) {
            match slot.effect.law() {
                Law::Sensor(law) => slot.pass(law.as_ref(), theta, drive, &mut known.mean),
                Law::MeasurementNoise(law) => known.parts.push(NoisePart {
                    output: slot.place.target,
                    level: law(slot.place.m(theta)),
                    memory: None,
                    start: 0.0,
                    source: noise_of(slot.place.target),
                }),
                _ => {}
            }
        }
        Ok(Some(known))
    }
}

/// Name of the draws of an output's added noise.
fn noise_of(channel: usize) -> String {
    format!("sensor-noise/{channel}")
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
        let known = self.before_readings(theta, drive)?;
        let is_known = known.is_some();
        let mut outputs = match known {
            Some(known) => known.draw(noise),
            None => {
                let actuated = self.slots.actuated(theta, drive)?;
                let acting = actuated.as_ref().unwrap_or(drive);
                (self.base).simulate(&theta[..self.slots.base], acting, noise)?
            }
        };
        // `all` is sorted along the signal: sensors, noise, saturation, rounding, outliers.
        for slot in (self.slots.all.iter()).filter(|slot| !is_known || slot.is_of_readings()) {
            match slot.effect.law() {
                Law::Sensor(law) => slot.pass(law.as_ref(), theta, drive, &mut outputs),
                Law::MeasurementNoise(law) => {
                    let level = law(slot.place.m(theta));
                    let channel = slot.place.target;
                    let mut source = noise.source(&noise_of(channel));
                    for value in outputs.column_mut(channel) {
                        *value += level * source.normal();
                    }
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
        match self.slots.all.iter().any(Slot::is_of_readings) {
            true => Ok(None),
            false => self.before_readings(theta, drive),
        }
    }
}
