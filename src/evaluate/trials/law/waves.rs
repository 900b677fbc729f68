//! Samples of Gaussian processes by random Fourier features.

use crate::evaluate::trials::numbers::TRIAL;
use crate::twin::Source;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// One sample of a stationary Gaussian process with a squared-exponential covariance: Σ a·cos(w·z + b).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::evaluate::trials) struct Waves {
    frequencies: Vec<Vec<f64>>,
    amplitudes: Vec<f64>,
    phases: Vec<f64>,
}

impl Waves {
    /// Draws a sample over standardised arguments; `length` is its length scale in their unit.
    pub fn draw(arguments: usize, length: f64, source: &mut Source) -> Self {
        let scale = (2.0 / TRIAL.wave_features as f64).sqrt();
        let (mut frequencies, mut amplitudes, mut phases) = (vec![], vec![], vec![]);
        for _ in 0..TRIAL.wave_features {
            frequencies.push((0..arguments).map(|_| source.normal() / length).collect());
            amplitudes.push(scale * source.normal());
            phases.push(TAU * source.uniform());
        }
        Self {
            frequencies,
            amplitudes,
            phases,
        }
    }

    /// The value at these arguments.
    pub fn at(&self, z: &[f64]) -> f64 {
        (self
            .frequencies
            .iter()
            .zip(&self.amplitudes)
            .zip(&self.phases))
        .map(|((w, a), b)| {
            let angle: f64 = w.iter().zip(z).map(|(w, z)| w * z).sum();
            a * (angle + b).cos()
        })
        .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Noise;

    /// Over samples the variance is 1, and the correlation at one length scale exp(−½) = 0.61.
    #[test]
    fn samples_have_the_covariance_of_their_process() {
        let (mut square, mut product) = (0.0, 0.0);
        let n = 2000;
        for i in 0..n {
            let waves = Waves::draw(1, 0.5, &mut Noise::new(2, "waves", i).source("w"));
            let (a, b) = (waves.at(&[0.2]), waves.at(&[0.7]));
            square += a * a / n as f64;
            product += a * b / n as f64;
        }
        assert!((square - 1.0).abs() < 0.15, "{square}");
        assert!((product - 0.61).abs() < 0.12, "{product}");
    }
}
