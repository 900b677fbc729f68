//! A path from one state to another.

use crate::effect::{Given, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// Another state acts on this one: ẋ + rate·x_from.
///
/// Magnitude: `rate` in units of the state per second and unit of `from`, of either sign, off at 0.
///
/// ```
/// use truetwin::effect::CrossCoupling;
/// use truetwin::effect::{Given, UnmodelledEffect};
///
/// let effect = CrossCoupling { target: "x".into(), from: "z".into(), magnitudes: Given::default() };
/// assert_eq!(effect.force(&[0.5], 0.0, 2.0, 3.0), 1.5);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CrossCoupling {
    /// The state.
    pub target: String,
    /// The state that acts on it.
    pub from: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "cross-coupling")]
impl UnmodelledEffect for CrossCoupling {
    accessors!(from);

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![Magnitude::signed(
            "rate",
            "state/(from·s)",
            &[-0.3, -0.1, 0.1, 0.3],
        )]
    }

    fn law(&self) -> Law {
        Law::Force
    }

    fn force(&self, m: &[f64], _t: f64, _x: f64, from: f64) -> f64 {
        m[0] * from
    }
}
