//! A sensor that follows slowly.

use super::laws::{TAU, lag};
use crate::effect::{Given, Instant, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// A first-order lag: z ← a·z + (1 − a)·s with a = exp(−Δt/τ); the reading is z, which starts at the first s.
///
/// Magnitude: `tau` (τ) in seconds, 0 or more, off at 0.
///
/// ```
/// use truetwin::effect::SensorLag;
/// use truetwin::effect::{Given, Instant, UnmodelledEffect};
///
/// let effect = SensorLag { target: "sensor".into(), magnitudes: Given::default() };
/// let now = Instant { t: 2.0, dt: 0.5 };
/// let mut memory = [0.0];
/// let read = effect.signal(&[0.5], now, &mut memory, 1.0); // τ is one step
/// assert!((read - (1.0 - (-1.0f64).exp())).abs() < 1e-12);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorLag {
    /// `sensor`, or `sensor1`… where there are several.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "sensor-lag")]
impl UnmodelledEffect for SensorLag {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![TAU]
    }

    fn law(&self) -> Law {
        Law::Sensor
    }

    fn order(&self) -> u32 {
        40
    }

    fn memory(&self) -> usize {
        1
    }

    fn signal(&self, m: &[f64], now: Instant, memory: &mut [f64], s: f64) -> f64 {
        lag(m[0], now.dt, &mut memory[0], s)
    }
}
