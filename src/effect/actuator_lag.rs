//! An actuator that follows slowly.

use super::laws::{TAU, lag};
use crate::effect::{Given, Instant, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// A first-order lag: v ← a·v + (1 − a)·u with a = exp(−Δt/τ); v starts at the first u.
///
/// Magnitude: `tau` (τ) in seconds, 0 or more, off at 0.
///
/// ```
/// use truetwin::effect::ActuatorLag;
/// use truetwin::effect::{Given, Instant, UnmodelledEffect};
///
/// let effect = ActuatorLag { target: "actuator".into(), magnitudes: Given::default() };
/// let now = Instant { t: 2.0, dt: 0.5 };
/// let mut memory = [0.0];
/// let acts = effect.signal(&[0.5], now, &mut memory, 1.0); // τ is one step
/// assert!((acts - (1.0 - (-1.0f64).exp())).abs() < 1e-12);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActuatorLag {
    /// `actuator`, or `actuator1`… where there are several.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "actuator-lag")]
impl UnmodelledEffect for ActuatorLag {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![TAU]
    }

    fn law(&self) -> Law {
        Law::Actuator
    }

    fn order(&self) -> u32 {
        70
    }

    fn memory(&self) -> usize {
        1
    }

    fn signal(&self, m: &[f64], now: Instant, memory: &mut [f64], u: f64) -> f64 {
        lag(m[0], now.dt, &mut memory[0], u)
    }
}
