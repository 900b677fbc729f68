//! An actuator with a limited range.

use super::laws::{HIGH, LOW, clamp};
use crate::effect::{Given, Instant, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// A limited range: clamp(u, low, high).
///
/// Magnitudes: `low` and `high` in the unit of the signal, off at −∞ and +∞. Where low exceeds high, high wins.
///
/// ```
/// use truetwin::effect::ActuatorSaturation;
/// use truetwin::effect::{Given, Instant, UnmodelledEffect};
///
/// let effect = ActuatorSaturation { target: "actuator".into(), magnitudes: Given::default() };
/// let now = Instant { t: 2.0, dt: 0.5 };
/// assert_eq!(effect.signal(&[0.0, 1.0], now, &mut [], 2.5), 1.0);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActuatorSaturation {
    /// `actuator`, or `actuator1`… where there are several.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "actuator-saturation")]
impl UnmodelledEffect for ActuatorSaturation {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![LOW, HIGH]
    }

    fn law(&self) -> Law {
        Law::Actuator
    }

    fn order(&self) -> u32 {
        50
    }

    fn signal(&self, m: &[f64], _now: Instant, _memory: &mut [f64], u: f64) -> f64 {
        clamp(u, m[0], m[1])
    }
}
