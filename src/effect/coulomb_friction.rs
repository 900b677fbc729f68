//! Dry friction.

use super::laws::sign;
use crate::effect::{Given, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// A loss of constant size against the sign of the state: ẋ − force·sign x, with sign 0 = 0.
///
/// Magnitude: `force` in units of the state per second, 0 or more, off at 0.
///
/// ```
/// use truetwin::effect::CoulombFriction;
/// use truetwin::effect::{Given, UnmodelledEffect};
///
/// let effect = CoulombFriction { target: "x".into(), magnitudes: Given::default() };
/// assert_eq!(effect.force(&[0.5], 0.0, -2.0, 0.0), 0.5); // against the motion
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoulombFriction {
    /// The state.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "coulomb-friction")]
impl UnmodelledEffect for CoulombFriction {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![Magnitude::positive("force", "state/s", &[0.03, 0.1, 0.3])]
    }

    fn law(&self) -> Law {
        Law::Force
    }

    fn force(&self, m: &[f64], _t: f64, x: f64, _from: f64) -> f64 {
        -m[0] * sign(x)
    }
}
