//! Terms in the rate of a state, and changes of a parameter over time.

use super::Moment;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// The course of a periodic force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(in crate::evaluate::trials) enum Wave {
    /// A sine.
    Sine,
    /// Straight up and down, between the same ends.
    Triangle,
    /// A sine whose amplitude varies slowly by a fifth.
    Swelling,
}

/// A term of a rate, in units of the state per second. `of` is the number of the state that it depends on.
///
/// Where a law has a width (`onset`, `width`, `span`, `rounding`), 0 or nothing is its textbook form.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(in crate::evaluate::trials) enum ForceDeparture {
    /// Constant once `onset` seconds are over.
    Constant { force: f64, onset: f64 },
    /// −force·sign x; within `width` it grows smoothly.
    Friction { force: f64, of: usize, width: f64 },
    /// rate·x; beyond `span` it gives way.
    Linear {
        rate: f64,
        of: usize,
        span: Option<f64>,
    },
    /// −c·|x|^e·sign x.
    Power {
        coefficient: f64,
        exponent: f64,
        of: usize,
        rounding: f64,
    },
    /// A wave of so many Hz.
    Periodic {
        amplitude: f64,
        frequency: f64,
        phase: f64,
        wave: Wave,
    },
}

impl ForceDeparture {
    /// The term at a moment.
    pub fn at(&self, now: &Moment<'_>) -> f64 {
        let x = |of: usize| now.x[of];
        match *self {
            Self::Constant { force, onset } if onset > 0.0 => force * (now.t / onset).min(1.0),
            Self::Constant { force, .. } => force,
            Self::Friction { force, of, width } => {
                let x = x(of);
                if width > 0.0 {
                    -force * (x / width).tanh()
                } else if x > 0.0 {
                    -force
                } else if x < 0.0 {
                    force
                } else {
                    0.0
                }
            }
            Self::Linear { rate, of, span } => match span {
                None => rate * x(of),
                Some(span) => rate * span * (x(of) / span).atan(),
            },
            Self::Power {
                coefficient,
                exponent,
                of,
                rounding,
            } => {
                let x = x(of);
                let size = (x * x + rounding * rounding).sqrt();
                // At rest there is no force, whatever the exponent.
                if size == 0.0 {
                    0.0
                } else {
                    -coefficient * size.powf(exponent - 1.0) * x
                }
            }
            Self::Periodic {
                amplitude,
                frequency,
                phase,
                wave,
            } => {
                let angle = TAU * frequency * now.t + phase;
                amplitude
                    * match wave {
                        Wave::Sine => angle.sin(),
                        Wave::Triangle => angle.sin().asin() * 4.0 / TAU,
                        Wave::Swelling => angle.sin() * (1.0 + 0.2 * (0.13 * angle).sin()),
                    }
            }
        }
    }
}

/// A factor on a parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(in crate::evaluate::trials) enum ParameterDeparture {
    /// 1 + size from `time` on, reached over `ramp` seconds.
    Step { size: f64, time: f64, ramp: f64 },
    /// 1 + rate·t, or exp(rate·t).
    Drift { rate: f64, exponential: bool },
}

impl ParameterDeparture {
    /// The factor at time `t`.
    pub fn at(&self, t: f64) -> f64 {
        match *self {
            Self::Step { size, time, ramp } if ramp > 0.0 => {
                1.0 + size * ((t - time) / ramp).clamp(0.0, 1.0)
            }
            Self::Step { size, time, .. } if t >= time => 1.0 + size,
            Self::Step { .. } => 1.0,
            Self::Drift { rate, exponential } if exponential => (rate * t).exp(),
            Self::Drift { rate, .. } => 1.0 + rate * t,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(law: &ForceDeparture, t: f64, x: [f64; 2]) -> f64 {
        law.at(&Moment {
            t,
            x: &x,
            u: &[2.0],
            own: 0.0,
        })
    }

    #[test]
    fn known_values() {
        let drag = |rounding| ForceDeparture::Power {
            coefficient: 0.5,
            exponent: 2.0,
            of: 1,
            rounding,
        };
        assert_eq!(at(&drag(0.0), 0.0, [9.0, -3.0]), 4.5);
        assert!((at(&drag(0.1), 0.0, [9.0, -3.0]) - 4.5).abs() < 0.01);
        let root = ForceDeparture::Power {
            coefficient: 1.0,
            exponent: 0.5,
            of: 0,
            rounding: 0.0,
        };
        assert_eq!(at(&root, 0.0, [0.0, 0.0]), 0.0);
        let triangle = ForceDeparture::Periodic {
            amplitude: 2.0,
            frequency: 0.25,
            phase: 0.0,
            wave: Wave::Triangle,
        };
        for (t, force) in [(0.0, 0.0), (0.5, 1.0), (1.0, 2.0), (3.0, -2.0)] {
            assert!((at(&triangle, t, [0.0; 2]) - force).abs() < 1e-9);
        }
    }

    #[test]
    fn a_step_and_its_ramp_meet_at_both_ends() {
        let law = |ramp| ParameterDeparture::Step {
            size: 0.5,
            time: 1.0,
            ramp,
        };
        let (step, ramp) = (law(0.0), law(0.5));
        assert_eq!([0.9, 1.0, 3.0].map(|t| step.at(t)), [1.0, 1.5, 1.5]);
        assert_eq!([1.0, 3.0].map(|t| ramp.at(t)), [1.0, 1.5]);
        assert!((ramp.at(1.2) - 1.2).abs() < 1e-12);
    }
}
