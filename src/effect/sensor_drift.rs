//! A sensor whose zero walks away.

use crate::effect::{Given, Instant, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// A zero that moves steadily from the first sample on: s + rate·t.
///
/// Magnitude: `rate` in units of the signal per second, of either sign, off at 0.
///
/// ```
/// use truetwin::effect::SensorDrift;
/// use truetwin::effect::{Given, Instant, UnmodelledEffect};
///
/// let effect = SensorDrift { target: "sensor".into(), magnitudes: Given::default() };
/// let now = Instant { t: 2.0, dt: 0.5 };
/// assert_eq!(effect.signal(&[0.25], now, &mut [], 1.0), 1.5);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorDrift {
    /// `sensor`, or `sensor1`… where there are several.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "sensor-drift")]
impl UnmodelledEffect for SensorDrift {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![Magnitude::signed(
            "rate",
            "signal/s",
            &[-0.01, -0.001, 0.001, 0.01],
        )]
    }

    fn law(&self) -> Law {
        Law::Sensor
    }

    fn order(&self) -> u32 {
        30
    }

    fn signal(&self, m: &[f64], now: Instant, _memory: &mut [f64], s: f64) -> f64 {
        s + m[0] * now.t
    }
}
