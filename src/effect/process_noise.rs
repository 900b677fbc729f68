//! A process noisier than the twin says.

use crate::effect::{Given, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// White noise on a state, an increment N(0, std²) a step, in quadrature with the twin's own.
///
/// Magnitude: `std` of the increment in the unit of the state, 0 or more, off at 0.
///
/// ```
/// use truetwin::effect::ProcessNoise;
/// use truetwin::effect::{Given, UnmodelledEffect};
///
/// let effect = ProcessNoise { target: "x".into(), magnitudes: Given::default() };
/// assert_eq!(effect.noise_level(&[0.3]), 0.3); // joins the increment of the twin in quadrature
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProcessNoise {
    /// The state.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "process-noise")]
impl UnmodelledEffect for ProcessNoise {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![Magnitude::positive("std", "state", &[0.01, 0.05, 0.2])]
    }

    fn law(&self) -> Law {
        Law::ProcessNoise
    }

    fn noise_level(&self, m: &[f64]) -> f64 {
        m[0]
    }
}
