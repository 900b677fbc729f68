//! A loss in proportion to the state.

use crate::effect::{Given, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// Leakage, cooling, viscous friction: ẋ − rate·x.
///
/// Magnitude: `rate` in 1/s, 0 or more, off at 0.
///
/// ```
/// use truetwin::effect::LinearLoss;
/// use truetwin::effect::{Given, UnmodelledEffect};
///
/// let effect = LinearLoss { target: "x".into(), magnitudes: Given::default() };
/// assert_eq!(effect.force(&[0.5], 0.0, 2.0, 0.0), -1.0);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinearLoss {
    /// The state.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "linear-loss")]
impl UnmodelledEffect for LinearLoss {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![Magnitude::positive("rate", "1/s", &[0.03, 0.1, 0.3])]
    }

    fn law(&self) -> Law {
        Law::Force
    }

    fn force(&self, m: &[f64], _t: f64, x: f64, _from: f64) -> f64 {
        -m[0] * x
    }
}
