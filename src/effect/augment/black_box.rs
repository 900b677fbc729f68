//! A black box with effects on its signals.

use super::Slots;
use super::finish::finish;
use crate::effect::law::Law;
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
        let mut outputs = (self.base).simulate(&theta[..self.slots.base], acting, noise)?;
        // `all` is sorted along the signal: sensors, noise, saturation, rounding, outliers.
        for slot in &self.slots.all {
            match slot.effect.law() {
                Law::Sensor(law) => slot.pass(law.as_ref(), theta, drive, &mut outputs),
                Law::MeasurementNoise(law) => {
                    let level = law(slot.place.m(theta));
                    let channel = slot.place.target;
                    let mut source = noise.source(&format!("sensor-noise/{channel}"));
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
}
