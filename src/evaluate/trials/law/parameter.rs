//! Changes of a parameter over time.

use serde::{Deserialize, Serialize};

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
