//! A sensor with a limited range.

use super::laws::{HIGH, LOW, clamp};
use super::marks::clipped;
use crate::effect::{Given, Instant, Law, Magnitude, Mark, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// A limited range, after the noise: clamp(s, low, high).
///
/// Magnitudes: `low` and `high` in the unit of the signal, off at −∞ and +∞. Where low exceeds high, high wins.
///
/// ```
/// use truetwin::effect::SensorSaturation;
/// use truetwin::effect::{Given, Instant, UnmodelledEffect};
///
/// let effect = SensorSaturation { target: "sensor".into(), magnitudes: Given::default() };
/// let now = Instant { t: 2.0, dt: 0.5 };
/// assert_eq!(effect.signal(&[-1.0, 1.0], now, &mut [], 2.5), 1.0);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorSaturation {
    /// `sensor`, or `sensor1`… where there are several.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "sensor-saturation")]
impl UnmodelledEffect for SensorSaturation {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![LOW, HIGH]
    }

    fn law(&self) -> Law {
        Law::Sensor
    }

    fn order(&self) -> u32 {
        80
    }

    fn mark(&self, outputs: &[f64]) -> Mark {
        clipped(outputs)
    }

    fn signal(&self, m: &[f64], _now: Instant, _memory: &mut [f64], s: f64) -> f64 {
        clamp(s, m[0], m[1])
    }
}
