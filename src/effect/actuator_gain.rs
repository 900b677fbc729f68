//! An actuator whose scale is off.

use crate::effect::{Given, Instant, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// A relative error of the scale: u·(1 + error).
///
/// Magnitude: `error` without unit, −1 (a dead actuator) or more, off at 0.
///
/// ```
/// use truetwin::effect::ActuatorGain;
/// use truetwin::effect::{Given, Instant, UnmodelledEffect};
///
/// let effect = ActuatorGain { target: "actuator".into(), magnitudes: Given::default() };
/// let now = Instant { t: 2.0, dt: 0.5 };
/// assert_eq!(effect.signal(&[0.5], now, &mut [], 2.0), 3.0);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActuatorGain {
    /// `actuator`, or `actuator1`… where there are several.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "actuator-gain")]
impl UnmodelledEffect for ActuatorGain {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![Magnitude::signed("error", "1", &[-0.2, -0.05, 0.05, 0.2]).within(-1.0, f64::INFINITY)]
    }

    fn law(&self) -> Law {
        Law::Actuator
    }

    fn order(&self) -> u32 {
        10
    }

    fn signal(&self, m: &[f64], _now: Instant, _memory: &mut [f64], u: f64) -> f64 {
        u * (1.0 + m[0])
    }
}
