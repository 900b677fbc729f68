//! Baselines: the prediction-error method, the dual Kalman filter, and their starts.

mod dual_ekf;
mod prediction_error;

pub use dual_ekf::dual_filter;
pub use prediction_error::prediction_error;

use crate::twin::{Noise, ParameterSpace, TwinError};
use serde::Serialize;
use std::fmt;

/// Numbers of the authors' code of Lakshminarayanan, Guerrero & Rojas.
struct BaselineNumbers {
    /// Steps at most; the paper's six.
    pub iterations: usize,
    /// λ, in squared output units by squared parameter units.
    pub ridge: f64,
    /// Step of differences, in prior widths.
    pub step: f64,
    /// Halvings of a step before giving up.
    pub halvings: usize,
    /// Variance of each state at the first row.
    pub state_variance: f64,
    /// Variance of each parameter at the first row.
    pub parameter_variance: f64,
    /// Variance added to each state a step.
    pub state_walk: f64,
    /// Variance added to each parameter a step.
    pub parameter_walk: f64,
    /// Standard deviation of the measurement.
    pub measurement: f64,
    /// Step of differences, relative to the scale of what is varied.
    pub difference: f64,
    /// Standard deviation of the factor of a good start.
    pub good_spread: f64,
}

const BASELINE: BaselineNumbers = BaselineNumbers {
    iterations: 6,
    ridge: 1e-3,
    step: 1e-4,
    halvings: 12,
    state_variance: 1e-2,
    parameter_variance: 0.1,
    state_walk: 1e-5,
    parameter_walk: 1e-7,
    measurement: 0.02,
    difference: 1e-5,
    good_spread: 0.1,
};

/// Where a baseline starts, in trials where the true θ is known.
///
/// | start | θ |
/// |---|---|
/// | good | each true parameter times 1 + N(0, 0.1²), brought into the bounds |
/// | ts | θ_init, the pretrained estimate |
/// | bad | for each parameter the bound farther from the truth |
///
/// Source: Lakshminarayanan, Guerrero & Rojas, section V; the spread is that of the authors' code.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Initialisation {
    /// Near the truth.
    Good,
    /// At the pretrained estimate.
    Ts,
    /// Far from the truth.
    Bad,
}

impl Initialisation {
    /// All, in the order of the paper's table.
    pub const ALL: [Self; 3] = [Self::Good, Self::Ts, Self::Bad];

    /// θ within the bounds, where `truth` is the true θ and `initial` is θ_init; `noise` is read by good starts, from its source `start`.
    pub fn theta(
        self,
        space: &ParameterSpace,
        truth: &[f64],
        initial: &[f64],
        noise: Noise,
    ) -> Result<Vec<f64>, TwinError> {
        space.check_point(truth)?;
        Ok(match self {
            Self::Good => {
                let mut source = noise.source("start");
                let near: Vec<f64> = (truth.iter())
                    .map(|v| v * (1.0 + BASELINE.good_spread * source.normal()))
                    .collect();
                space.clamp(&near)
            }
            Self::Ts => {
                let inside = space.clamp(initial);
                space.check_point(&inside)?;
                inside
            }
            Self::Bad => (space.bounds().iter().zip(truth))
                .map(|(b, v)| {
                    if v - b.low() > b.high() - v {
                        b.low()
                    } else {
                        b.high()
                    }
                })
                .collect(),
        })
    }
}

impl fmt::Display for Initialisation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Parameter;

    fn space() -> ParameterSpace {
        ParameterSpace::new([
            Parameter::new("a", "-", 1.0, 2.0).within(0.0, 10.0),
            Parameter::new("b", "-", 1.0, 2.0).within(0.5, 2.5),
        ])
    }

    /// Factor 1 + N(0, 0.1²), also for the second parameter, and clipped to its bounds.
    #[test]
    fn good_starts_scatter_by_a_tenth() {
        let n = 4000u32;
        let (mut mean, mut square) = (0.0, 0.0);
        for i in 0..n {
            let noise = Noise::new(1, "good", i.into());
            let theta =
                (Initialisation::Good.theta(&space(), &[4.0, 2.4], &[0.0; 2], noise)).unwrap();
            assert!(space().check_point(&theta).is_ok());
            mean += (theta[0] / 4.0 - 1.0) / f64::from(n);
            square += (theta[0] / 4.0 - 1.0).powi(2) / f64::from(n);
        }
        // sd of the mean 0.0016, relative sd of the variance 0.022.
        assert!(
            mean.abs() < 0.0075 && (square / 0.01 - 1.0).abs() < 0.11,
            "{mean} {square}"
        );
    }

    #[test]
    fn seeds_are_contracts() {
        let noise = Noise::new(1, "good", 0);
        let theta = |i| {
            Initialisation::Good
                .theta(&space(), &[4.0, 2.0], &[0.0; 2], i)
                .unwrap()
        };
        assert_eq!(theta(noise), theta(noise));
        assert_eq!(theta(Noise::OFF), [4.0, 2.0]);
    }

    #[test]
    fn bad_starts_are_the_farther_bounds() {
        let bad = |truth: [f64; 2]| {
            (Initialisation::Bad.theta(&space(), &truth, &[], Noise::OFF)).unwrap()
        };
        assert_eq!(bad([9.0, 0.6]), [0.0, 2.5]);
        assert_eq!(bad([1.0, 2.4]), [10.0, 0.5]);
    }

    #[test]
    fn the_estimate_is_brought_into_the_bounds() {
        let of =
            |initial: &[f64]| Initialisation::Ts.theta(&space(), &[4.0, 2.0], initial, Noise::OFF);
        assert_eq!(of(&[11.0, 1.0]).unwrap(), [10.0, 1.0]);
        assert!(of(&[1.0]).is_err());
    }
}
