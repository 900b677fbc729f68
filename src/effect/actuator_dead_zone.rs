//! An actuator that ignores small commands.

use super::laws::clamp;
use crate::effect::{Given, Instant, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// Commands inside ±width/2 do nothing, larger ones lose that much: u − clamp(u, ±width/2).
///
/// Magnitude: `width` in the unit of the signal, 0 or more, off at 0.
///
/// ```
/// use truetwin::effect::ActuatorDeadZone;
/// use truetwin::effect::{Given, Instant, UnmodelledEffect};
///
/// let effect = ActuatorDeadZone { target: "actuator".into(), magnitudes: Given::default() };
/// let now = Instant { t: 2.0, dt: 0.5 };
/// assert_eq!(effect.signal(&[0.5], now, &mut [], 1.0), 0.75);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActuatorDeadZone {
    /// `actuator`, or `actuator1`… where there are several.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "actuator-dead-zone")]
impl UnmodelledEffect for ActuatorDeadZone {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![Magnitude::positive("width", "signal", &[0.1, 0.4, 1.0])]
    }

    fn law(&self) -> Law {
        Law::Actuator
    }

    fn order(&self) -> u32 {
        30
    }

    fn signal(&self, m: &[f64], _now: Instant, _memory: &mut [f64], u: f64) -> f64 {
        u - clamp(u, -0.5 * m[0], 0.5 * m[0])
    }
}
