//! An actuator that acts late.

use super::laws::{DELAY, DELAY_SAMPLES, check_delay, delay};
use crate::effect::{Given, Instant, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// A dead time: u(t − delay), linear between samples, the first value before the start.
///
/// Magnitude: `delay` in seconds, 0 or more and at most 63 steps, off at 0.
///
/// ```
/// use truetwin::effect::ActuatorDelay;
/// use truetwin::effect::{Given, Instant, UnmodelledEffect};
///
/// let effect = ActuatorDelay { target: "actuator".into(), magnitudes: Given::default() };
/// let now = Instant { t: 2.0, dt: 0.5 };
/// let mut memory = vec![1.0; effect.memory()];
/// assert_eq!(effect.signal(&[0.5], now, &mut memory, 3.0), 1.0); // one step late
/// assert_eq!(effect.signal(&[0.5], now, &mut memory, 5.0), 3.0);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActuatorDelay {
    /// `actuator`, or `actuator1`… where there are several.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "actuator-delay")]
impl UnmodelledEffect for ActuatorDelay {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![DELAY]
    }

    fn law(&self) -> Law {
        Law::Actuator
    }

    fn order(&self) -> u32 {
        80
    }

    fn check(&self, m: &[f64], dt: f64) -> Result<(), String> {
        check_delay(m[0], dt)
    }

    fn memory(&self) -> usize {
        DELAY_SAMPLES
    }

    fn least_memory(&self) -> usize {
        2
    }

    fn signal(&self, m: &[f64], now: Instant, memory: &mut [f64], u: f64) -> f64 {
        delay(m[0], now.dt, memory, u)
    }
}
