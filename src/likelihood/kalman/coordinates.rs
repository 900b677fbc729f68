//! Coordinates in which parameters are alike.

use crate::math::nearest;
use crate::twin::ParameterSpace;
use nalgebra::DVector;

/// Step of a difference in log θ.
const LOG_STEP: f64 = 1e-3;
/// Step of a difference in θ, as a share of the prior's width.
const LINEAR_STEP: f64 = 1e-2;

/// φ: log θ_j where the lower bound of θ_j is positive, otherwise θ_j itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Coordinates {
    log: Vec<bool>,
    steps: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    theta_lower: Vec<f64>,
    theta_upper: Vec<f64>,
    held: Vec<bool>,
    unled: Vec<bool>,
}

impl Coordinates {
    /// Creates the coordinates of a twin's parameters.
    pub fn new(space: &ParameterSpace) -> Self {
        let log = space.iter().map(|p| p.bounds.low() > 0.0).collect();
        Self::with(space, log)
    }

    /// The same, logarithms where this says so.
    pub(crate) fn with(space: &ParameterSpace, log: Vec<bool>) -> Self {
        let theta_lower: Vec<f64> = space.iter().map(|p| p.bounds.low()).collect();
        let theta_upper: Vec<f64> = space.iter().map(|p| p.bounds.high()).collect();
        let steps = (log.iter().zip(space.widths()))
            .map(|(log, width)| if *log { LOG_STEP } else { LINEAR_STEP * width })
            .collect();
        Self {
            lower: forward(&log, &theta_lower),
            upper: forward(&log, &theta_upper),
            held: vec![false; log.len()],
            unled: vec![false; log.len()],
            log,
            steps,
            theta_lower,
            theta_upper,
        }
    }

    /// The same, some entries held: no derivative is taken by them.
    pub(crate) fn holding(self, held: Vec<bool>) -> Self {
        Self { held, ..self }
    }

    /// The same, one-sided slopes by some entries left where they are taken, half a step away.
    pub(crate) fn leaving(self, unled: Vec<bool>) -> Self {
        Self { unled, ..self }
    }

    /// Returns whether one-sided slopes by an entry are led back to where the step begins.
    pub(super) fn leads_back(&self, j: usize) -> bool {
        !self.unled[j]
    }

    /// Entries by which derivatives are taken.
    pub(super) fn free(&self) -> Vec<usize> {
        (0..self.held.len()).filter(|&j| !self.held[j]).collect()
    }

    /// φ of θ.
    pub fn of(&self, theta: &[f64]) -> Vec<f64> {
        forward(&self.log, theta)
    }

    /// θ of φ, within the bounds.
    pub fn theta(&self, phi: &[f64]) -> Vec<f64> {
        (0..phi.len())
            .map(|j| {
                let value = if self.log[j] { phi[j].exp() } else { phi[j] };
                nearest(value, self.theta_lower[j], self.theta_upper[j])
            })
            .collect()
    }

    /// The nearest φ within the bounds.
    pub fn clamp(&self, phi: &DVector<f64>) -> DVector<f64> {
        DVector::from_fn(phi.len(), |j, _| {
            nearest(phi[j], self.lower[j], self.upper[j])
        })
    }

    /// φ with entry j moved by `share` of its step, downwards where the upper bound is nearer; and how far it moved, rounding included.
    pub(crate) fn beside(&self, phi: &[f64], j: usize, share: f64) -> (Vec<f64>, f64) {
        let step = share * self.steps[j];
        let mut moved = phi.to_vec();
        moved[j] += if moved[j] + step <= self.upper[j] {
            step
        } else {
            -step
        };
        let distance = moved[j] - phi[j];
        (moved, distance)
    }

    /// ∂θ/∂φ at θ.
    pub fn slopes(&self, theta: &[f64]) -> Vec<f64> {
        (self.log.iter().zip(theta))
            .map(|(log, v)| if *log { *v } else { 1.0 })
            .collect()
    }

    /// Returns whether each φ is a logarithm.
    pub fn is_log(&self) -> &[bool] {
        &self.log
    }

    /// Steps of differences in φ: 1e-3 in a logarithm, otherwise 1e-2 of the prior's width.
    pub fn steps(&self) -> &[f64] {
        &self.steps
    }

    /// Lower bounds of φ.
    pub fn lower(&self) -> &[f64] {
        &self.lower
    }

    /// Upper bounds of φ.
    pub fn upper(&self) -> &[f64] {
        &self.upper
    }
}

fn forward(log: &[bool], theta: &[f64]) -> Vec<f64> {
    (log.iter().zip(theta))
        .map(|(log, v)| if *log { v.ln() } else { *v })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Parameter;

    #[test]
    fn back_and_forth_stays_within_the_bounds() {
        let space = ParameterSpace::new([
            Parameter::new("k", "-", 0.3, 0.7).within(0.1, 1.5),
            Parameter::new("c", "-", -1.0, 1.0),
        ]);
        let phi = Coordinates::new(&space);
        assert_eq!(phi.is_log(), [true, false]);
        let theta = phi.theta(&phi.of(&[0.45, -0.3]));
        assert!((theta[0] - 0.45).abs() < 1e-15 && theta[1] == -0.3);
        assert_eq!(phi.theta(phi.upper()), [1.5, 1.0]);
        assert_eq!(phi.slopes(&[0.45, 9.0]), [0.45, 1.0]);
    }
}
