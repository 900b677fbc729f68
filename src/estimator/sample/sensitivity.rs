//! Draws along single parameters, wide where the features hardly react.

use super::sampler::Sampler;
use crate::twin::Noise;
use nalgebra::DVector;

/// One parameter at a time, with a spread inverse to its sensitivity:
///
/// ```text
/// θ = centre + ζ·eᵢ,   i ~ Unif{1 … d},   ζ ~ N(0, rᵢ²),   rᵢ = d_med·Δ_misfit / ‖J eᵢ‖
/// ```
///
/// with the whitened Jacobian J (n × d), the whitened misfit Δ_misfit at the centre and the median whitened distance
/// d_med of simulations from their mean. A radius never exceeds `reach`, the half-width of the parameter's bounds:
/// beyond it every draw would be rejected.
///
/// Source: Lakshminarayanan, Guerrero & Rojas, section IV-B, sensitivity sampling.
#[derive(Debug, Clone)]
pub struct Sensitivity {
    centre: DVector<f64>,
    radii: Vec<f64>,
}

impl Sensitivity {
    /// `sensitivities` are ‖J eⱼ‖ (inverse parameter units), `spread` is d_med·Δ_misfit, `reach` in parameter units.
    pub fn new(centre: DVector<f64>, sensitivities: &[f64], spread: f64, reach: &[f64]) -> Self {
        let radii = (sensitivities.iter().zip(reach))
            // An insensitive parameter gives an infinite radius, which its reach caps.
            .map(|(s, reach)| (spread / s.max(f64::MIN_POSITIVE)).min(*reach))
            .collect();
        Self { centre, radii }
    }

    /// rⱼ, in parameter units.
    #[cfg(test)]
    pub fn radii(&self) -> &[f64] {
        &self.radii
    }
}

impl Sampler for Sensitivity {
    fn draw(&self, _index: u64, noise: Noise) -> DVector<f64> {
        let mut source = noise.source("sensitivity");
        let d = self.centre.len();
        let axis = ((source.uniform() * d as f64) as usize).min(d - 1);
        let mut theta = self.centre.clone();
        theta[axis] += self.radii[axis] * source.normal();
        theta
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_axis_in_turn_with_its_own_spread() {
        let sampler = Sensitivity::new(DVector::zeros(3), &[2.0, 0.5, 0.0], 1.0, &[9.0, 9.0, 4.0]);
        assert_eq!(sampler.radii(), [0.5, 2.0, 4.0]);
        let n = 6000;
        let (mut count, mut square) = ([0.0; 3], [0.0; 3]);
        for i in 0..n {
            let theta = sampler.draw(i, Noise::new(1, "test", i));
            let axis = theta.iter().position(|v| *v != 0.0).unwrap();
            assert_eq!(theta.iter().filter(|v| **v != 0.0).count(), 1);
            count[axis] += 1.0;
            square[axis] += theta[axis].powi(2);
        }
        for j in 0..3 {
            // Binomial sd of a third of 6000: 36; relative sd of a variance from 2000: 0.032.
            assert!((count[j] - 2000.0f64).abs() < 160.0, "{count:?}");
            let ratio = square[j] / count[j] / sampler.radii()[j].powi(2);
            assert!((ratio - 1.0).abs() < 0.15, "axis {j}: {ratio}");
        }
    }
}
