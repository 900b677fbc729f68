//! A parameter that wears off.

use crate::effect::{Given, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// Wear, fouling, warming up: θ·(1 + rate·t).
///
/// Magnitude: `rate` in 1/s, of either sign, off at 0.
///
/// ```
/// use truetwin::effect::ParameterDrift;
/// use truetwin::effect::{Given, UnmodelledEffect};
///
/// let effect = ParameterDrift { target: "k".into(), magnitudes: Given::default() };
/// assert_eq!(effect.parameter(&[0.5], 1.0, 4.0), 6.0);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterDrift {
    /// The parameter.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "parameter-drift")]
impl UnmodelledEffect for ParameterDrift {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![Magnitude::signed(
            "rate",
            "1/s",
            &[-0.01, -0.001, 0.001, 0.01],
        )]
    }

    fn law(&self) -> Law {
        Law::Parameter
    }

    fn parameter(&self, m: &[f64], t: f64, value: f64) -> f64 {
        value * (1.0 + m[0] * t)
    }
}
