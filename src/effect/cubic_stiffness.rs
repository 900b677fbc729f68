//! A spring that hardens.

use crate::effect::{Given, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// A Duffing spring: ẋ − c·x_from³, where `from` is the state whose rate this one is. Below 0 the spring softens.
///
/// Magnitude: `coefficient` (c) in units of the state per second and cubed unit of `from`, of either sign, off at 0.
///
/// ```
/// use truetwin::effect::CubicStiffness;
/// use truetwin::effect::{Given, UnmodelledEffect};
///
/// let effect = CubicStiffness { target: "v".into(), from: "z".into(), magnitudes: Given::default() };
/// assert_eq!(effect.force(&[0.5], 0.0, 0.0, 2.0), -4.0);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CubicStiffness {
    /// The state.
    pub target: String,
    /// The state whose rate the target is.
    pub from: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "cubic-stiffness")]
impl UnmodelledEffect for CubicStiffness {
    accessors!(from);

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![Magnitude::signed(
            "coefficient",
            "state/(from³·s)",
            &[-0.1, 0.1, 0.3],
        )]
    }

    fn law(&self) -> Law {
        Law::Force
    }

    fn force(&self, m: &[f64], _t: f64, _x: f64, from: f64) -> f64 {
        -m[0] * from.powi(3)
    }
}
