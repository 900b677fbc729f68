//! The van der Pol oscillator.

use crate::twin::{Now, Outline, Parameter, StateSpace};

/// Van der Pol oscillator with unknown damping ν:
///
/// ```text
/// ẋ₁ = x₂,   ẋ₂ = ν·(1 − x₁²)·x₂ − x₁ + w,   y = x₁,   start (1, 0)
/// ```
///
/// w ~ N(0, 0.02) stands inside the equation and is held over an Euler step, so the increment of x₂ has the
/// standard deviation Δt·√0.02 (0.00707 at Δt = 0.05 s). The position is measured without error.
///
/// Source: Lakshminarayanan, Guerrero & Rojas, section V-A.
#[derive(Debug, Clone, Copy, Default)]
pub struct VanDerPol;

impl StateSpace for VanDerPol {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("nu", "-", 0.0, 2.5).within(0.0, 7.0))
            .state("x1", "-")
            .state("x2", "1/s")
            .output("y", "-")
    }

    #[inline]
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        dx[0] = x[1];
        dx[1] = now.theta[0] * (1.0 - x[0] * x[0]) * x[1] - x[0];
    }

    #[inline]
    fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }

    fn start(&self, _: &Now<'_>, x: &mut [f64]) {
        x.copy_from_slice(&[1.0, 0.0]);
    }

    #[inline]
    fn noise(&self, now: &Now<'_>, _: &[f64], process: &mut [f64], _: &mut [f64]) {
        process[1] = now.dt * 0.02f64.sqrt();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Drive;
    use crate::twin::{DigitalTwin, Noise};

    /// For large t the amplitude of the limit cycle is close to 2, whatever ν.
    #[test]
    fn settles_on_the_limit_cycle() {
        let drive = Drive::autonomous(0.01, 6000).unwrap();
        for nu in [0.5, 1.5] {
            let y = VanDerPol.simulate(&[nu], &drive, Noise::OFF).unwrap();
            let amplitude = y.iter().skip(4000).fold(0.0f64, |a, v| a.max(v.abs()));
            assert!((amplitude - 2.0).abs() < 0.05, "nu {nu}: {amplitude}");
        }
    }
}
