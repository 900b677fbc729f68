//! Twins that show their equations.

use crate::record::{Drive, Signal};
use crate::twin::{Integrator, Interval, Noise, Now, Outline, SimulationError, Workspace};

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
pub trait StateSpace: Advance + Send + Sync {
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

    /// Noise levels: standard deviation of the increment added to each state a step, and of each output.
    /// None by default. Both slices come zeroed.
    fn noise(&self, _now: &Now<'_>, _process: &mut [f64], _measurement: &mut [f64]) {}

    /// Boxes that the states are held in after each step; unbounded by default.
    fn limits(&self) -> Vec<Interval> {
        vec![Interval::EVERYTHING; self.outline().states.len()]
    }

    /// Constraints that are no boxes (an overflow from one state into another), after noise, before limits.
    fn constrain(&self, _now: &Now<'_>, _x: &mut [f64]) {}

    /// Moves states that change at samples only (memories), before the motion starts; none by default.
    fn update(&self, _now: &Now<'_>, _x: &mut [f64]) {}

    /// Changes the outputs after their noise (saturation, quantisation); leaves them alone by default.
    fn readout(&self, _now: &Now<'_>, _y: &mut [f64]) {}

    /// Checks once before a run that θ can be simulated at this step; every θ can by default.
    fn check_parameters(&self, _theta: &[f64], _dt: f64) -> Result<(), SimulationError> {
        Ok(())
    }

    /// Corrupts the finished outputs of a run (outliers); leaves them alone by default.
    fn corrupt_outputs(&self, _theta: &[f64], _noise: Noise, _outputs: &mut Signal) {}

    /// Probability and size of the outliers of [`corrupt_outputs`](Self::corrupt_outputs) for filters, by output; empty
    /// without any.
    fn outliers(&self, _theta: &[f64]) -> Vec<Outliers> {
        vec![]
    }

    /// Integrator that carries the drift over a step.
    fn integrator(&self) -> Integrator {
        Integrator::Euler
    }

    /// One run. Wrappers that leave the motion alone run the twin that they hold.
    #[doc(hidden)]
    fn run(&self, theta: &[f64], drive: &Drive, noise: Noise) -> Result<Signal, SimulationError> {
        self.run_equations(theta, drive, noise)
    }
}

/// The step, which every twin with equations has and none defines.
///
/// It is implemented for all of them at once and can be for no single one, so a step that twins made of others would
/// not know cannot exist. As a supertrait of [`StateSpace`] it is compiled once for each twin, the equations inline:
/// a filter that holds a `dyn StateSpace` then pays one call for all its points.
pub trait Advance {
    /// One step without noise and limits: memories, then motion.
    fn advance(&self, now: &Now<'_>, x: &mut [f64], work: &mut Workspace);

    /// Simulates the equations.
    #[doc(hidden)]
    fn run_equations(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError>;

    /// Carries points over a step; see [`Points`]. Returns whether a constraint acted on any that matters to the noise.
    #[doc(hidden)]
    fn advance_each(&self, now: &Now<'_>, points: Points<'_>, work: &mut Workspace) -> bool;

    /// Outputs, `p` each, of points, `n` each.
    #[doc(hidden)]
    fn observe_each(&self, now: &Now<'_>, sizes: (usize, usize), points: &[f64], y: &mut [f64]);

    /// Puts outputs, `p` each, through the readout; returns whether it changed any.
    #[doc(hidden)]
    fn readout_each(&self, now: &Now<'_>, p: usize, y: &mut [f64]) -> bool;
}

/// Points that a filter carries over a step; n states each, one point after the other.
#[doc(hidden)]
#[derive(Debug)]
pub struct Points<'w> {
    /// Put into the limits, advanced, constrained; the first is the centre.
    pub moving: &'w mut [f64],
    /// Limits by state.
    pub limits: &'w [Interval],
    /// Two for each state: the centre after its motion, with that state shifted up and down; constrained. Those of a
    /// state without shift are left alone.
    pub shifted: &'w mut [f64],
    /// Shift of each state.
    pub shifts: &'w [f64],
}

/// Rare large errors: with this probability, N(0, scale²) is added to a sample.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Outliers {
    /// Probability of each sample.
    pub probability: f64,
    /// Standard deviation, in the unit of the signal.
    pub scale: f64,
}
