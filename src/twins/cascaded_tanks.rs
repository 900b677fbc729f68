//! Two water tanks, one above the other.

use crate::twin::{Interval, Now, Outline, Parameter, StateSpace};

/// Below this level the outflow law √h is evaluated here, so that its slope stays finite.
const SMALLEST_LEVEL: f64 = 1e-6;

/// Cascaded tanks: a pump fills the upper tank, which runs into the lower one:
///
/// ```text
/// ḣ₁ = −k₁·√|h₁| + k₄·u,   ḣ₂ = k₂·√|h₁| − k₃·√|h₂|,   y = h₂ + v,   start (0, 0)
/// ```
///
/// Each level gets N(0, 0.1²) a step, the output N(0, 0.15²); levels are held in [0, 10]. The scaling h₁ → c·h₁,
/// (k₁, k₂, k₄) → (k₁√c, k₂/√c, c·k₄) leaves the output unchanged but for noise and the upper limit, so one
/// direction in θ is known from the noise alone.
///
/// Source: Lakshminarayanan, Guerrero & Rojas, section V-B, after Wigren & Schoukens (2013). The output's
/// standard deviation is that of the authors' code.
#[derive(Debug, Clone, Copy, Default)]
pub struct CascadedTanks;

impl StateSpace for CascadedTanks {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("k1", "-", 0.4, 0.8).within(0.1, 1.5))
            .parameter(Parameter::new("k2", "-", 0.4, 0.8).within(0.1, 1.5))
            .parameter(Parameter::new("k3", "-", 0.4, 0.8).within(0.1, 1.5))
            .parameter(Parameter::new("k4", "-", 0.8, 1.2).within(0.5, 1.5))
            .state("h1", "V")
            .state("h2", "V")
            .input("u", "V")
            .output("y", "V")
            .describe("h1", "upper tank")
            .describe("h2", "lower tank")
            .describe("u", "pump")
            .describe("y", "lower level")
    }

    #[inline]
    fn drift(&self, now: &Now<'_>, h: &[f64], dh: &mut [f64]) {
        let &[k1, k2, k3, k4] = now.theta else {
            unreachable!("the outline declares four parameters")
        };
        let upper = h[0].abs().max(SMALLEST_LEVEL).sqrt();
        let lower = h[1].abs().max(SMALLEST_LEVEL).sqrt();
        dh[0] = -k1 * upper + k4 * now.u[0];
        dh[1] = k2 * upper - k3 * lower;
    }

    #[inline]
    fn observe(&self, _: &Now<'_>, h: &[f64], y: &mut [f64]) {
        y[0] = h[1];
    }

    #[inline]
    fn noise(&self, _: &Now<'_>, _: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        process.fill(0.1);
        measurement[0] = 0.15;
    }

    fn limits(&self) -> Vec<Interval> {
        vec![Interval::unchecked(0.0, 10.0); 2]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Drive, Signal};
    use crate::twin::{DigitalTwin, Noise};

    fn step_response(theta: &[f64]) -> Signal {
        let drive = Drive::new(0.5, Signal::from_elem((2000, 1), 1.5)).unwrap();
        CascadedTanks.simulate(theta, &drive, Noise::OFF).unwrap()
    }

    /// At rest k₁√h₁ = k₄u and k₂√h₁ = k₃√h₂.
    #[test]
    fn settles_where_flows_balance() {
        let y = step_response(&[0.6, 0.5, 0.55, 1.0]);
        let level = (0.5 / 0.55 * 1.0 * 1.5 / 0.6f64).powi(2);
        assert!((y[[1999, 0]] - level).abs() < 1e-6);
    }

    #[test]
    fn scaling_the_upper_level_leaves_the_output_unchanged() {
        let (c, [k1, k2, k3, k4]) = (1.3f64, [0.6, 0.5, 0.55, 1.0]);
        let scaled = step_response(&[k1 * c.sqrt(), k2 / c.sqrt(), k3, c * k4]);
        let difference = &step_response(&[k1, k2, k3, k4]) - &scaled;
        // Below the smallest level the law is no power law: equality up to that.
        assert!(difference.iter().all(|d| d.abs() < 1e-3));
    }
}
