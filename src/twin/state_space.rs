//! Twins that show their equations.

use super::points::{advance_one_by_one, readout_one_by_one};
use crate::math::{LANES, Lanes};
use crate::record::{Drive, Signal};
use crate::twin::{
    Integrator, Interval, LanePoints, Layout, Noise, Now, Outline, Points, SimulationError,
    Stepping, Workspace,
};

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

    /// Standard deviations of the state at the first sample, around [`start`](Self::start): a filter integrates over it, a noisy
    /// run draws from it. Zero, a known start, by default; the slice comes zeroed.
    fn start_deviation(&self, _now: &Now<'_>, _std: &mut [f64]) {}

    /// Sets the states that follow from the others at the first sample: memories of effects.
    #[doc(hidden)]
    fn begin(&self, _now: &Now<'_>, _x: &mut [f64]) {}

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

    /// Changes the finished outputs of a run (rounding, outliers); leaves them alone by default.
    fn corrupt_outputs(&self, _theta: &[f64], _noise: Noise, _outputs: &mut Signal) {}

    /// Steps to which [`corrupt_outputs`](Self::corrupt_outputs) rounds, for filters, by output, 0 for none; empty without any. A filter
    /// takes an output for all signals that are rounded to it, whatever the offset of the steps.
    fn rounding(&self, _theta: &[f64]) -> Vec<f64> {
        vec![]
    }

    /// Probability and size of the outliers of [`corrupt_outputs`](Self::corrupt_outputs) for filters, by output; empty without any.
    fn outliers(&self, _theta: &[f64]) -> Vec<Outliers> {
        vec![]
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

    /// The drive behind the actuators, where effects stand there; `None` where inputs act as they are recorded. Inputs do not depend on
    /// states, so that filters need no states for what actuators remember.
    #[doc(hidden)]
    fn actuated(&self, _theta: &[f64], _drive: &Drive) -> Result<Option<Drive>, SimulationError> {
        Ok(None)
    }

    /// Whole samples by which each output shows late what [`observe`](Self::observe) says; empty where none is. A run holds the outputs back
    /// before their noise, the first ones in place of those before the start; a filter takes the record's values so much earlier.
    #[doc(hidden)]
    fn dead_time(&self, _theta: &[f64], _dt: f64) -> Vec<usize> {
        vec![]
    }
    /// One run. Wrappers that leave the motion alone run the twin that they hold.
    #[doc(hidden)]
    fn run(&self, theta: &[f64], drive: &Drive, noise: Noise) -> Result<Signal, SimulationError> {
        self.run_equations(theta, drive, noise)
    }

    /// Rates of several points. Twins made of others pass this and the following calls on, one for all points.
    #[doc(hidden)]
    fn drift_each(&self, now: &Now<'_>, at: Layout, x: &[f64], dx: &mut [f64]) {
        for (x, dx) in at.each(x).zip(at.each_mut(dx)) {
            self.drift(now, x, dx);
        }
    }

    /// Outputs, `p` each, of several points.
    #[doc(hidden)]
    fn observe_each(&self, now: &Now<'_>, at: Layout, p: usize, x: &[f64], y: &mut [f64]) {
        for (x, y) in at.each(x).zip(y.chunks_exact_mut(p)) {
            self.observe(now, x, y);
        }
    }

    /// Moves what changes at samples only, of several points.
    #[doc(hidden)]
    fn update_each(&self, now: &Now<'_>, at: Layout, x: &mut [f64]) {
        for x in at.each_mut(x) {
            self.update(now, x);
        }
    }

    /// Constrains several points.
    #[doc(hidden)]
    fn constrain_each(&self, now: &Now<'_>, at: Layout, x: &mut [f64]) {
        for x in at.each_mut(x) {
            self.constrain(now, x);
        }
    }

    /// Puts outputs, `p` each, through the readout; returns whether it changed any.
    #[doc(hidden)]
    fn readout_each(&self, now: &Now<'_>, p: usize, y: &mut [f64]) -> bool {
        match p {
            1 => readout_one_by_one(1, y, |y| self.readout(now, y)),
            p => readout_one_by_one(p, y, |y| self.readout(now, y)),
        }
    }

    /// Carries the points of a filter over a step; returns whether a constraint acted on any that matters to the noise.
    #[doc(hidden)]
    fn advance_each(&self, now: &Now<'_>, points: Points<'_>, work: &mut Workspace) -> bool {
        // Loops of known length, for the sizes of most twins.
        let advance = |x: &mut [f64]| self.advance(now, x, work);
        let constrain = |x: &mut [f64]| self.constrain(now, x);
        match points.shifts.len() {
            1 => advance_one_by_one(1, points, advance, constrain),
            2 => advance_one_by_one(2, points, advance, constrain),
            3 => advance_one_by_one(3, points, advance, constrain),
            4 => advance_one_by_one(4, points, advance, constrain),
            5 => advance_one_by_one(5, points, advance, constrain),
            n => advance_one_by_one(n, points, advance, constrain),
        }
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

    /// Carries the points of several filters over a step, one filter a lane; returns as [`advance_each`](Self::advance_each) for
    /// each of them.
    #[doc(hidden)]
    fn advance_lanes(
        &self,
        now: &[Now<'_>],
        points: LanePoints<'_>,
        work: &mut Workspace,
    ) -> [bool; LANES];

    /// One output of the points, `n` states each, of several filters, one filter a lane; `buffer` holds those of one of them.
    #[doc(hidden)]
    fn observe_lanes(
        &self,
        now: &[Now<'_>],
        n: usize,
        x: &[Lanes],
        y: &mut [Lanes],
        buffer: &mut [f64],
    );

    /// Noise levels of the states, four at most, and the output of several filters, one filter a lane.
    #[doc(hidden)]
    fn noise_lanes(&self, now: &[Now<'_>], process: &mut [Lanes], measurement: &mut Lanes);

    /// Puts values of one output of several filters, one filter a lane, through the readout; returns the lanes that it changed.
    #[doc(hidden)]
    fn readout_lanes(&self, now: &[Now<'_>], y: &mut [Lanes]) -> [bool; LANES];
}

/// Rare large errors: with this probability, N(0, scale²) is added to a sample.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Outliers {
    /// Probability of each sample.
    pub probability: f64,
    /// Standard deviation, in the unit of the signal.
    pub scale: f64,
}
