//! Twins that show their equations.

use crate::twin::{Integrator, Interval, Now, Outline, SimulationError, Stepping};

/// A twin given by its equations
///
/// ```text
/// ẋ = f(t, x, u, θ)            drift, carried over a step by an integrator
/// x ← x + Q·w,  w ~ N(0, I)     noise, added once a step
/// y = g(t, x, u, θ) + R·v       observe, v ~ N(0, I)
/// ```
///
/// Three methods are required; it is then a [`DigitalTwin`](super::DigitalTwin), and everything that needs equations (filters,
/// effects in the dynamics, unknown starts) works with it.
///
/// # Order within a sample
///
/// Row k is y(t_k), observed first; then u_k acts from t_k to t_k + Δt: [`update`](Self::update), drift, noise,
/// [`constrain`](Self::constrain), [`limits`](Self::limits). Row 0 is the start.
///
/// The integrator may take several steps within a sample, and inputs may lie on the line to the next sample ([`stepping`](Self::stepping)).
/// The drift and the limits then act at each substep, as with a finer step; update, noise and constraints once a sample.
///
/// ```
/// use truetwin::prelude::*;
///
/// /// A leaking tank: ḣ = u − k·h.
/// struct Tank;
/// impl StateSpace for Tank {
///     fn outline(&self) -> Outline {
///         Outline::new()
///             .parameter(Parameter::new("k", "1/s", 0.1, 1.0))
///             .state("h", "m")
///             .input("u", "m/s")
///             .output("y", "m")
///     }
///     fn drift(&self, now: &Now, x: &[f64], dx: &mut [f64]) {
///         dx[0] = now.u[0] - now.theta[0] * x[0];
///     }
///     fn observe(&self, _: &Now, x: &[f64], y: &mut [f64]) {
///         y[0] = x[0];
///     }
/// }
/// let y = Tank.simulate(&[0.5], &Drive::new(0.1, Signal::ones((3, 1)))?, Noise::OFF)?;
/// assert_eq!(y.column(0).to_vec(), [0.0, 0.1, 0.195]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait StateSpace: Send + Sync {
    /// Parameters, states, inputs and outputs with names and units.
    fn outline(&self) -> Outline;

    /// `dx` = f: rates of the states `x`, in state units per second.
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]);

    /// `y` = g: outputs of `x` without noise.
    fn observe(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]);

    /// State at the first sample; zero by default.
    fn start(&self, _now: &Now<'_>, x: &mut [f64]) {
        x.fill(0.0);
    }

    /// Standard deviations of the state at the first sample, around [`start`](Self::start): a filter integrates over it, a noisy
    /// run draws from it. Zero, a known start, by default; the slice comes zeroed.
    fn start_deviation(&self, _now: &Now<'_>, _std: &mut [f64]) {}

    /// Noise levels: standard deviation of the increment added to each state a step, and of each output.
    /// None by default. Both slices come zeroed.
    fn noise(&self, _now: &Now<'_>, _process: &mut [f64], _measurement: &mut [f64]) {}

    /// Boxes that the states are held in after each step and substep; unbounded by default.
    fn limits(&self) -> Vec<Interval> {
        vec![Interval::EVERYTHING; self.outline().states.len()]
    }

    /// Constraints that are no boxes (an overflow from one state into another), after noise, before limits.
    fn constrain(&self, _now: &Now<'_>, _x: &mut [f64]) {}

    /// Moves states that change at samples only (memories), before the motion starts; none by default.
    fn update(&self, _now: &Now<'_>, _x: &mut [f64]) {}

    /// Changes the outputs after their noise (saturation); leaves them alone by default.
    fn readout(&self, _now: &Now<'_>, _y: &mut [f64]) {}

    /// Checks once before a run that θ can be simulated at this step; every θ can by default.
    fn check_parameters(&self, _theta: &[f64], _dt: f64) -> Result<(), SimulationError> {
        Ok(())
    }

    /// Integrator that carries the drift over a step.
    fn integrator(&self) -> Integrator {
        Integrator::Euler
    }

    /// Substeps of the integrator within a sample, and inputs between samples; one, with inputs held, by default. A study file
    /// changes them: `[record] substeps` and `hold`.
    fn stepping(&self) -> Stepping {
        Stepping::default()
    }
}

/// Rare large errors: with this probability, N(0, scale²) is added to a sample.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Outliers {
    /// Probability of each sample.
    pub probability: f64,
    /// Standard deviation, in the unit of the signal.
    pub scale: f64,
}
