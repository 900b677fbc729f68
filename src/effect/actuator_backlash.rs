//! An actuator with play in its gears.

use super::laws::clamp;
use crate::effect::{Given, Instant, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// Play: v ← clamp(v, u ± width/2). After a reversal nothing moves until the play is used up; v starts at the first u.
///
/// Magnitude: `width` of the play in the unit of the signal, 0 or more, off at 0.
///
/// ```
/// use truetwin::effect::ActuatorBacklash;
/// use truetwin::effect::{Given, Instant, UnmodelledEffect};
///
/// let effect = ActuatorBacklash { target: "actuator".into(), magnitudes: Given::default() };
/// let now = Instant { t: 2.0, dt: 0.5 };
/// let mut memory = [0.0];
/// assert_eq!(effect.signal(&[0.5], now, &mut memory, 1.0), 0.75); // half the play is lost
/// assert_eq!(effect.signal(&[0.5], now, &mut memory, 0.75), 0.75); // and a way back does nothing yet
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActuatorBacklash {
    /// `actuator`, or `actuator1`… where there are several.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "actuator-backlash")]
impl UnmodelledEffect for ActuatorBacklash {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![Magnitude::positive("width", "signal", &[0.1, 0.4, 1.0])]
    }

    fn law(&self) -> Law {
        Law::Actuator
    }

    fn order(&self) -> u32 {
        40
    }

    fn memory(&self) -> usize {
        1
    }

    fn signal(&self, m: &[f64], _now: Instant, memory: &mut [f64], u: f64) -> f64 {
        memory[0] = clamp(memory[0], u - 0.5 * m[0], u + 0.5 * m[0]);
        memory[0]
    }
}
