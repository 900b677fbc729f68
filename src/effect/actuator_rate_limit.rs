//! An actuator with a limited speed.

use crate::effect::{Given, Instant, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// A limited speed: v ← v + clamp(u − v, ±rate·Δt); v starts at the first u.
///
/// Magnitude: `rate` in units of the signal per second, 0 or more, off at +∞.
///
/// ```
/// use truetwin::effect::ActuatorRateLimit;
/// use truetwin::effect::{Given, Instant, UnmodelledEffect};
///
/// let effect = ActuatorRateLimit { target: "actuator".into(), magnitudes: Given::default() };
/// let now = Instant { t: 2.0, dt: 0.5 };
/// let mut memory = [0.0];
/// assert_eq!(effect.signal(&[1.0], now, &mut memory, 2.0), 0.5);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActuatorRateLimit {
    /// `actuator`, or `actuator1`… where there are several.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "actuator-rate-limit")]
impl UnmodelledEffect for ActuatorRateLimit {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![Magnitude::positive("rate", "signal/s", &[0.1, 0.5, 2.0]).off(f64::INFINITY)]
    }

    fn law(&self) -> Law {
        Law::Actuator
    }

    fn order(&self) -> u32 {
        60
    }

    fn memory(&self) -> usize {
        1
    }

    fn signal(&self, m: &[f64], now: Instant, memory: &mut [f64], u: f64) -> f64 {
        let (v, reach) = (&mut memory[0], m[0] * now.dt);
        // v + (u − v) is not u to the bit; within reach, u it is.
        *v = if u - *v > reach {
            *v + reach
        } else if *v - u > reach {
            *v - reach
        } else {
            u
        };
        *v
    }
}
