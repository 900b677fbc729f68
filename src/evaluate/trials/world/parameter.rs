//! Changes of a parameter over time.

use crate::twin::Noise;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A factor on a parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(in crate::evaluate::trials) enum ParameterLaw {
    /// 1 + size from `time` on, reached over `ramp` seconds.
    Step { size: f64, time: f64, ramp: f64 },
    /// 1 + rate·t, or exp(rate·t).
    Drift { rate: f64, exponential: bool },
    /// exp of a random walk with this standard deviation after a second.
    Wander { std: f64 },
    /// 1 + amplitude·sin(2π·f·t).
    Oscillation { amplitude: f64, frequency: f64 },
}

impl ParameterLaw {
    /// The factor at each of `samples` samples, held until the next.
    pub(super) fn factors(&self, samples: usize, dt: f64, noise: Noise) -> Vec<f64> {
        let mut walk = noise.source("wander");
        let mut log = 0.0;
        (0..samples)
            .map(|k| k as f64 * dt)
            .map(|t| match *self {
                Self::Step { size, time, ramp } if ramp > 0.0 => {
                    1.0 + size * ((t - time) / ramp).clamp(0.0, 1.0)
                }
                Self::Step { size, time, .. } if t >= time => 1.0 + size,
                Self::Step { .. } => 1.0,
                Self::Drift { rate, exponential } if exponential => (rate * t).exp(),
                Self::Drift { rate, .. } => 1.0 + rate * t,
                Self::Wander { std } => {
                    log += std * dt.sqrt() * walk.normal();
                    f64::exp(log)
                }
                Self::Oscillation {
                    amplitude,
                    frequency,
                } => 1.0 + amplitude * (TAU * frequency * t).sin(),
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_and_its_ramp_meet_at_both_ends() {
        let factors = |ramp| {
            let law = ParameterLaw::Step {
                size: 0.5,
                time: 1.0,
                ramp,
            };
            law.factors(31, 0.1, Noise::OFF)
        };
        let (step, ramp) = (factors(0.0), factors(0.5));
        assert_eq!((step[9], step[10], step[30]), (1.0, 1.5, 1.5));
        assert_eq!((ramp[10], ramp[30]), (1.0, 1.5));
        assert!((ramp[12] - 1.2).abs() < 1e-12);
    }

    /// The logarithm after 100 s has the standard deviation 10·std.
    #[test]
    fn a_walk_wanders_as_far_as_theory_says() {
        let law = ParameterLaw::Wander { std: 0.01 };
        let ends: Vec<f64> = (0..400)
            .map(|i| law.factors(1001, 0.1, Noise::new(1, "t", i))[1000].ln())
            .collect();
        let std = (ends.iter().map(|e| e * e).sum::<f64>() / 400.0).sqrt();
        assert!((std - 0.1).abs() < 4.5 * 0.1 / 800f64.sqrt(), "{std}");
    }
}
