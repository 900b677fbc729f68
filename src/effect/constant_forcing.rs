//! A constant push.

use crate::effect::{Given, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// A constant push or leak into a state: ẋ + force.
///
/// Magnitude: `force` in units of the state per second, of either sign, off at 0.
///
/// ```
/// use truetwin::effect::ConstantForcing;
/// use truetwin::effect::{Given, UnmodelledEffect};
///
/// let effect = ConstantForcing { target: "x".into(), magnitudes: Given::default() };
/// assert_eq!(effect.force(&[0.5], 0.0, 2.0, 0.0), 0.5);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConstantForcing {
    /// The state.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "constant-forcing")]
impl UnmodelledEffect for ConstantForcing {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![Magnitude::signed(
            "force",
            "state/s",
            &[-0.3, -0.1, 0.1, 0.3],
        )]
    }

    fn law(&self) -> Law {
        Law::Force
    }

    fn force(&self, m: &[f64], _t: f64, _x: f64, _from: f64) -> f64 {
        m[0]
    }
}
