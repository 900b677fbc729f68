//! A parameter that jumps.

use crate::effect::{Given, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// A fault or a switch: θ·(1 + size) from a time on, that instant included.
///
/// Magnitudes: `size` without unit, −1 (all gone) or more, off at 0; the shape `time` in seconds from the first sample,
/// 0 or more.
///
/// ```
/// use truetwin::effect::ParameterStep;
/// use truetwin::effect::{Given, UnmodelledEffect};
///
/// let effect = ParameterStep { target: "k".into(), magnitudes: Given::default() };
/// let at = |t| effect.parameter(&[0.5, 10.0], t, 4.0); // size, time
/// assert_eq!((at(9.0), at(10.0)), (4.0, 6.0));
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterStep {
    /// The parameter.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "parameter-step")]
impl UnmodelledEffect for ParameterStep {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![
            Magnitude::signed("size", "1", &[-0.3, -0.1, 0.1, 0.3]).within(-1.0, f64::INFINITY),
            Magnitude::positive("time", "s", &[30.0, 100.0, 200.0, 300.0]).shape(),
        ]
    }

    fn law(&self) -> Law {
        Law::Parameter
    }

    fn parameter(&self, m: &[f64], t: f64, value: f64) -> f64 {
        if t >= m[1] {
            value * (1.0 + m[0])
        } else {
            value
        }
    }
}
