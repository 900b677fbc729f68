//! A sensor noisier than the twin says.

use crate::effect::{Given, Law, Magnitude, NOISE_ENTERS, UnmodelledEffect};
use serde::{Deserialize, Serialize};

/// White measurement noise that joins the twin's in quadrature: variance r² + std².
///
/// A black box's own noise is already in its outputs; there, independent draws are added, to the same variance.
///
/// Magnitude: `std` in the unit of the signal, 0 or more, off at 0.
///
/// ```
/// use truetwin::effect::SensorNoise;
/// use truetwin::effect::{Given, UnmodelledEffect};
///
/// let effect = SensorNoise { target: "sensor".into(), magnitudes: Given::default() };
/// assert_eq!(effect.noise_level(&[0.3]), 0.3); // joins the noise of the twin in quadrature
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorNoise {
    /// `sensor`, or `sensor1`… where there are several.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "sensor-noise")]
impl UnmodelledEffect for SensorNoise {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![Magnitude::positive("std", "signal", &[0.01, 0.05, 0.2])]
    }

    fn law(&self) -> Law {
        Law::MeasurementNoise
    }

    fn order(&self) -> u32 {
        NOISE_ENTERS
    }

    fn noise_level(&self, m: &[f64]) -> f64 {
        m[0]
    }
}
