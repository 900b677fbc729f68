//! Twins that show their equations, and the names and units in these.

use crate::record::{Quantity, Signals};
use crate::twin::{
    Event, Hold, Integrator, Interval, Now, Parameter, ParameterSpace, SimulationError, Stepping,
};
use std::collections::BTreeMap;

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
/// The drift and the limits then act at each substep, as with a finer step; update, noise and constraints once a sample. The
/// [events](Outline::event) of the outline act where they are, between samples, too.
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

    /// `dx` = f: rates of the states `x`, in state units per second; of a twin in discrete time ([`Integrator::Discrete`]) the states at
    /// the next sample.
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]);

    /// `y` = g: outputs of `x` without noise.
    fn observe(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]);

    /// State at the first row; the slice comes zeroed. A state that is set here has a known start, unless
    /// [`start_deviation`](Self::start_deviation) or the study says otherwise, or the first row of a record shows another one. A state that is left
    /// alone, as all are by default, has an unknown start: simulations begin at zero, fits and diagnoses find it.
    fn start(&self, _now: &Now<'_>, _x: &mut [f64]) {}

    /// Standard deviations of the state at the first row, around [`start`](Self::start): a filter integrates over it, a noisy
    /// run draws from it. Zero by default; the slice comes zeroed.
    fn start_deviation(&self, _now: &Now<'_>, _std: &mut [f64]) {}

    /// Noise levels at the states `x`: standard deviation of the increment added to each state a step, and of each output.
    /// None by default. Both slices come zeroed.
    ///
    /// Levels may follow the states: `measurement[0] = 0.01 + 0.05 * x[0].abs()` is noise of 5 % of the reading. A simulation asks at the
    /// state of each sample, a filter at its predicted mean m. It neglects ½·P·(r²)″ in the variance r², P being the variance of the
    /// prediction: for noise of a share s of the signal, predicted as well as it is measured, s² of the variance (0.25 % at 5 %).
    ///
    /// Where a level is fitted, one factor multiplies the declared levels: their dependence on states and time stays.
    fn noise(&self, _now: &Now<'_>, _x: &[f64], _process: &mut [f64], _measurement: &mut [f64]) {}

    /// Boxes that the states are held in after each step and substep, and within steps that take rates between; unbounded by default.
    fn limits(&self) -> Vec<Interval> {
        vec![Interval::EVERYTHING; self.outline().states.len()]
    }

    /// Boxes of the states at these parameters, which the way between two samples has beside [`limits`](Self::limits); `None` by default. For the
    /// samples, [`constrain`](Self::constrain) holds the states.
    fn limits_at(&self, _now: &Now<'_>) -> Option<Vec<Interval>> {
        None
    }

    /// Constraints that are no boxes (an overflow from one state into another), after noise, before limits.
    fn constrain(&self, _now: &Now<'_>, _x: &mut [f64]) {}

    /// Times within this step at which the drift jumps whatever the states, in seconds on the record's own clock, as a switch at a time does; in
    /// any order, without those that do not concern it. [Adaptive](Integrator::Adaptive) and stiff steps end there, and all of a twin with
    /// events. `None` by default, for a drift
    /// that is smooth in time; a jump that is not told is located by its errors.
    fn jumps(&self, _now: &Now<'_>) -> Option<Vec<f64>> {
        None
    }

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

/// Names and units of everything in the equations; each call adds one at the end.
///
/// ```
/// use truetwin::twin::{Outline, Parameter};
///
/// let tank = Outline::new()
///     .parameter(Parameter::new("k", "m²/s", 0.2, 1.0).within(0.01, 3.0))
///     .state("h", "m")
///     .input("u", "m³/s")
///     .output("y", "m");
/// assert_eq!(tank.parameters.names(), ["k"]);
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Outline {
    /// Parameters, in the order of θ.
    pub parameters: ParameterSpace,
    /// States, in the order of x.
    pub states: Vec<Quantity>,
    /// Inputs, in the order of u.
    pub inputs: Vec<Quantity>,
    /// Outputs, in the order of y.
    pub outputs: Vec<Quantity>,
    /// Rules of inputs between samples, by name; the others are as [`stepping`](StateSpace::stepping) says.
    pub held: BTreeMap<String, Hold>,
    /// Changes of states at times or where conditions become true.
    pub events: Vec<Event>,
}

impl Outline {
    /// An outline without any names.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a parameter.
    #[must_use]
    pub fn parameter(mut self, parameter: Parameter) -> Self {
        self.parameters.push(parameter);
        self
    }

    /// Adds a state.
    #[must_use]
    pub fn state(mut self, name: &str, unit: &str) -> Self {
        self.states.push(Quantity::new(name, unit));
        self
    }

    /// Adds an input.
    #[must_use]
    pub fn input(mut self, name: &str, unit: &str) -> Self {
        self.inputs.push(Quantity::new(name, unit));
        self
    }

    /// Says what an input is between samples, whatever the other inputs are.
    #[must_use]
    pub fn hold(mut self, input: &str, hold: Hold) -> Self {
        self.held.insert(input.into(), hold);
        self
    }

    /// Adds an event.
    #[must_use]
    pub fn event(mut self, event: Event) -> Self {
        self.events.push(event);
        self
    }

    /// Adds an output.
    #[must_use]
    pub fn output(mut self, name: &str, unit: &str) -> Self {
        self.outputs.push(Quantity::new(name, unit));
        self
    }

    /// Describes a state, an input or an output for reports: `describe("h1", "upper tank")` is told as "the upper tank (h1)".
    #[must_use]
    pub fn describe(mut self, name: &str, description: &str) -> Self {
        let channels = self.inputs.iter_mut().chain(&mut self.outputs);
        for quantity in self.states.iter_mut().chain(channels) {
            if quantity.name == name {
                quantity.description = description.into();
            }
        }
        self
    }

    /// Rule of each input between samples; `usual` without one of its own.
    pub(crate) fn holds(&self, usual: Hold) -> Vec<Hold> {
        let inputs = self.inputs.iter();
        inputs.map(|input| self.hold_of(input, usual)).collect()
    }

    /// Rule of one input, as [`holds`](Self::holds) has it.
    pub(super) fn hold_of(&self, input: &Quantity, usual: Hold) -> Hold {
        self.held.get(&input.name).copied().unwrap_or(usual)
    }

    /// Input and output channels.
    pub(crate) fn signals(self) -> Signals {
        Signals {
            inputs: self.inputs,
            outputs: self.outputs,
        }
    }
}
