//! A sensor with coarse digits.

use super::marks::rounded;
use crate::effect::{Given, Instant, Law, Magnitude, Mark, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// Rounding to a multiple of the step, halves upwards: step·⌊s/step + ½⌋.
///
/// Magnitude: `step` in the unit of the signal, 0 or more, off at 0.
///
/// ```
/// use truetwin::effect::SensorQuantization;
/// use truetwin::effect::{Given, Instant, UnmodelledEffect};
///
/// let effect = SensorQuantization { target: "sensor".into(), magnitudes: Given::default() };
/// let now = Instant { t: 2.0, dt: 0.5 };
/// assert_eq!(effect.signal(&[0.5], now, &mut [], 1.2), 1.0);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorQuantization {
    /// `sensor`, or `sensor1`… where there are several.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "sensor-quantization")]
impl UnmodelledEffect for SensorQuantization {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![Magnitude::positive("step", "signal", &[0.02, 0.1, 0.5])]
    }

    fn law(&self) -> Law {
        Law::Sensor
    }

    fn order(&self) -> u32 {
        90
    }

    fn mark(&self, outputs: &[f64]) -> Mark {
        rounded(outputs)
    }

    fn signal(&self, m: &[f64], _now: Instant, _memory: &mut [f64], s: f64) -> f64 {
        if m[0] > 0.0 {
            m[0] * (s / m[0] + 0.5).floor()
        } else {
            s
        }
    }
}
