//! A vessel that overflows.

use crate::effect::{Given, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// A ceiling on a state, after each step: what exceeds the level is cut, and the part spill of it is added to the state
/// `to`. A twin of one state names itself: then the excess is lost.
///
/// Magnitudes: `level` in the unit of the state, off at +∞; the shape `spill` without unit, in [0, 1].
///
/// ```
/// use truetwin::effect::StateCeiling;
/// use truetwin::effect::{Given, UnmodelledEffect};
///
/// let effect = StateCeiling { target: "x".into(), to: "z".into(), magnitudes: Given::default() };
/// let (mut x, mut other) = (3.0, 1.0);
/// effect.limit(&[2.0, 0.5], &mut x, Some(&mut other)); // level, spill
/// assert_eq!((x, other), (2.0, 1.5));
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StateCeiling {
    /// The state.
    pub target: String,
    /// The state that takes what is spilt.
    pub to: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "state-ceiling")]
impl UnmodelledEffect for StateCeiling {
    accessors!(to);

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![
            Magnitude::signed("level", "state", &[0.5, 1.0, 2.0, 4.0]).off(f64::INFINITY),
            Magnitude::positive("spill", "1", &[0.0, 0.5, 1.0])
                .within(0.0, 1.0)
                .shape(),
        ]
    }

    fn law(&self) -> Law {
        Law::Limit
    }

    fn limit(&self, m: &[f64], x: &mut f64, to: Option<&mut f64>) {
        if *x > m[0] {
            if let Some(to) = to {
                *to += m[1] * (*x - m[0]);
            }
            *x = m[0];
        }
    }
}
