//! A sensor that reports late.

use super::laws::{DELAY, DELAY_SAMPLES, check_delay, delay};
use crate::effect::{Given, Instant, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// A dead time: s(t − delay), linear between samples, the first value before the start.
///
/// Magnitude: `delay` in seconds, 0 or more and at most 63 steps, off at 0.
///
/// ```
/// use truetwin::effect::SensorDelay;
/// use truetwin::effect::{Given, Instant, UnmodelledEffect};
///
/// let effect = SensorDelay { target: "sensor".into(), magnitudes: Given::default() };
/// let now = Instant { t: 2.0, dt: 0.5 };
/// let mut memory = vec![1.0; effect.memory()];
/// assert_eq!(effect.signal(&[0.5], now, &mut memory, 3.0), 1.0); // one step late
/// assert_eq!(effect.signal(&[0.5], now, &mut memory, 5.0), 3.0);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorDelay {
    /// `sensor`, or `sensor1`… where there are several.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "sensor-delay")]
impl UnmodelledEffect for SensorDelay {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![DELAY]
    }

    fn law(&self) -> Law {
        Law::Sensor
    }

    fn order(&self) -> u32 {
        50
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

    fn signal(&self, m: &[f64], now: Instant, memory: &mut [f64], s: f64) -> f64 {
        delay(m[0], now.dt, memory, s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::{augment, augment_short};
    use crate::record::{Drive, Signal};
    use crate::twin::{Noise, Twin};
    use crate::twins::CascadedTanks;
    use std::sync::Arc;

    #[test]
    fn delays_that_fit_a_short_register_are_exact() {
        let delay: Arc<dyn UnmodelledEffect> = Arc::new(SensorDelay {
            target: "sensor".into(),
            magnitudes: Given::default(),
        });
        let base = Twin::new(CascadedTanks);
        let long = augment(base.clone(), vec![delay.clone()]).unwrap();
        let short = augment_short(base, vec![(delay, 5)]).unwrap();
        let states = |twin: &Twin| twin.outline().unwrap().states.len();
        assert_eq!((states(&long), states(&short)), (2 + 64, 2 + 5));
        let u = Signal::from_shape_fn((80, 1), |(k, _)| (k % 17) as f64 / 6.0);
        let drive = Drive::new(0.5, u).unwrap();
        for delay in [0.0, 0.7, 2.0] {
            let theta = [0.6, 0.5, 0.55, 1.0, delay];
            let noise = Noise::new(1, "t", 0);
            let run = |twin: &Twin| twin.simulate(&theta, &drive, noise).unwrap();
            assert_eq!(run(&long), run(&short));
        }
    }
}
