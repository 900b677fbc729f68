//! A sensor that loses the sign.

use crate::effect::{Given, Instant, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// A part f of the signal is rectified: (1 − f)·s + f·|s|.
///
/// Magnitude: `fraction` (f) without unit, in [0, 1], off at 0.
///
/// ```
/// use truetwin::effect::SensorRectification;
/// use truetwin::effect::{Given, Instant, UnmodelledEffect};
///
/// let effect = SensorRectification { target: "sensor".into(), magnitudes: Given::default() };
/// let now = Instant { t: 2.0, dt: 0.5 };
/// assert_eq!(effect.signal(&[0.5], now, &mut [], -2.0), 0.0);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorRectification {
    /// `sensor`, or `sensor1`… where there are several.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "sensor-rectification")]
impl UnmodelledEffect for SensorRectification {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![Magnitude::positive("fraction", "1", &[0.1, 0.5, 0.9]).within(0.0, 1.0)]
    }

    fn law(&self) -> Law {
        Law::Sensor
    }

    fn order(&self) -> u32 {
        60
    }

    fn signal(&self, m: &[f64], _now: Instant, _memory: &mut [f64], s: f64) -> f64 {
        (1.0 - m[0]) * s + m[0] * s.abs()
    }
}
