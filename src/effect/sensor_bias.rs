//! A sensor whose zero is off.

use crate::effect::{Given, Instant, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// A constant error of the zero: s + offset.
///
/// Magnitude: `offset` in the unit of the signal, of either sign, off at 0.
///
/// ```
/// use truetwin::effect::SensorBias;
/// use truetwin::effect::{Given, Instant, UnmodelledEffect};
///
/// let effect = SensorBias { target: "sensor".into(), magnitudes: Given::default() };
/// let now = Instant { t: 2.0, dt: 0.5 };
/// assert_eq!(effect.signal(&[0.25], now, &mut [], 1.0), 1.25);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorBias {
    /// `sensor`, or `sensor1`… where there are several.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "sensor-bias")]
impl UnmodelledEffect for SensorBias {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![Magnitude::signed(
            "offset",
            "signal",
            &[-0.3, -0.1, 0.1, 0.3],
        )]
    }

    fn law(&self) -> Law {
        Law::Sensor
    }

    fn order(&self) -> u32 {
        10
    }

    fn signal(&self, m: &[f64], _now: Instant, _memory: &mut [f64], s: f64) -> f64 {
        s + m[0]
    }
}
