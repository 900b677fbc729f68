//! A loss with an unknown power of the state.

use super::laws::sign;
use crate::effect::{Given, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// An outflow or friction law that the twin lacks: ẋ − c·|x|^e·sign x, with sign 0 = 0. Below 0 it corrects a law that takes
/// too much.
///
/// Magnitudes: `coefficient` (c) in units of the state per second at |x| = 1, of either sign, off at 0; the shape
/// `exponent` (e) in [0, 4].
///
/// ```
/// use truetwin::effect::PowerLaw;
/// use truetwin::effect::{Given, UnmodelledEffect};
///
/// let effect = PowerLaw { target: "x".into(), magnitudes: Given::default() };
/// assert_eq!(effect.force(&[0.5, 1.5], 0.0, 4.0, 0.0), -4.0);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PowerLaw {
    /// The state.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "power-law")]
impl UnmodelledEffect for PowerLaw {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![
            Magnitude::signed("coefficient", "state^(1−e)/s", &[-0.1, 0.03, 0.1, 0.3]),
            Magnitude::positive("exponent", "1", &[0.5, 1.5, 2.5])
                .within(0.0, 4.0)
                .shape(),
        ]
    }

    fn law(&self) -> Law {
        Law::Force
    }

    fn force(&self, m: &[f64], _t: f64, x: f64, _from: f64) -> f64 {
        -m[0] * x.abs().powf(m[1]) * sign(x)
    }
}
