//! The twin of a text.

use super::declared::Declared;
use super::program::Program;
use crate::record::{Drive, Signal, Signals};
use crate::twin::{
    Blocks, Composed, DigitalTwin, Noise, ParameterSpace, SimulationError, StateSpace,
};
use std::sync::Arc;

/// A twin whose equations are text, as the files of studies have them; cheap to clone.
///
/// ```text
/// rate of a state:       dx/dt = f(x, u, t, θ)     or next: x at the next sample
/// value of an output:    y = g(x, u, t, θ)
/// noise, start, limits:  numbers or expressions
/// ```
///
/// ```
/// use truetwin::equations::Equations;
/// use truetwin::prelude::*;
///
/// let tank = Equations::parse(r#"
///     [parameters]
///     k = { unit = "1/s", prior = [0.2, 1.0], bounds = [0.05, 3.0] }
///     [states]
///     h = { unit = "m", rate = "u - k*h", start = 0.0 }
///     [inputs]
///     u = { unit = "m/s" }
///     [outputs]
///     y = { unit = "m", value = "h", noise = 0.02 }
///     [record]
///     integrator = "euler"
/// "#)?;
/// let y = tank.simulate(&[0.5], &Drive::new(0.1, Signal::ones((3, 1)))?, Noise::OFF)?;
/// assert_eq!(y.column(0).to_vec(), [0.0, 0.1, 0.195]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Equations {
    pub(super) name: String,
    pub(super) declared: Declared,
    pub(super) program: Arc<Program>,
    pub(super) text: Arc<str>,
}

impl Equations {
    /// Name of the twin.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the tables that the twin was read from, without comments.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns the equations as twins are held.
    pub(crate) fn composed(&self) -> Composed {
        self.composed_of(self.program.clone())
    }

    /// Returns equations that differ from these in their rates or outputs alone, as twins are held.
    pub(crate) fn composed_of<T: StateSpace + Blocks + 'static>(&self, own: Arc<T>) -> Composed {
        // Constraints act on one state after the other.
        let all = match self.program.tapes.ends {
            Some(_) => Composed::new(own),
            None => Composed::in_blocks(own),
        };
        match self.declared.begins {
            Some(at) => all.beginning(at),
            None => all,
        }
    }

    /// Returns what computes the expressions.
    pub(crate) fn program(&self) -> Arc<Program> {
        self.program.clone()
    }

    /// Declarations of noise and starts.
    pub(crate) fn declared(&self) -> &Declared {
        &self.declared
    }
}

impl DigitalTwin for Equations {
    fn parameters(&self) -> ParameterSpace {
        self.program.parameters()
    }

    fn signals(&self) -> Signals {
        self.program.signals()
    }

    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        match self.declared.begins {
            Some(_) => self.composed().run(theta, drive, noise),
            None => self.program.simulate(theta, drive, noise),
        }
    }

    fn free_run(&self, theta: &[f64], drive: &Drive) -> Result<Signal, SimulationError> {
        self.simulate(theta, drive, Noise::OFF)
    }

    fn equations(self: Arc<Self>) -> Option<Composed> {
        Some(self.composed())
    }
}
