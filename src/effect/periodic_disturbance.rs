//! A push that comes and goes.

use crate::effect::{Given, Law, Magnitude, UnmodelledEffect};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Vibration, mains hum, tides: ẋ + amplitude·sin(2π·f·t + phase).
///
/// Magnitudes: `amplitude` in units of the state per second, 0 or more, off at 0; the shapes `frequency` (f) in Hz, above
/// 0, and `phase` in radians, in [−2π, 2π].
///
/// ```
/// use truetwin::effect::PeriodicDisturbance;
/// use truetwin::effect::{Given, UnmodelledEffect};
///
/// let effect = PeriodicDisturbance { target: "x".into(), magnitudes: Given::default() };
/// let force = effect.force(&[0.5, 0.25, 0.0], 1.0, 0.0, 0.0); // a quarter of a period
/// assert!((force - 0.5).abs() < 1e-12);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PeriodicDisturbance {
    /// The state.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "periodic-disturbance")]
impl UnmodelledEffect for PeriodicDisturbance {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![
            Magnitude::positive("amplitude", "state/s", &[0.1, 0.3]),
            // A period of eleven days stands for "above 0".
            Magnitude::positive("frequency", "Hz", &[0.003, 0.01, 0.03, 0.1])
                .within(1e-6, f64::INFINITY)
                .shape(),
            Magnitude::signed("phase", "rad", &[0.0, 2.0, 4.0])
                .within(-TAU, TAU)
                .shape(),
        ]
    }

    fn law(&self) -> Law {
        Law::Force
    }

    fn force(&self, m: &[f64], t: f64, _x: f64, _from: f64) -> f64 {
        m[0] * (TAU * m[1] * t + m[2]).sin()
    }
}
