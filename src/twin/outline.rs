//! Names and units of a twin's equations.

use crate::record::{Quantity, Signals};
use crate::twin::{Parameter, ParameterSpace};

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

    /// Input and output channels.
    pub(crate) fn signals(self) -> Signals {
        Signals {
            inputs: self.inputs,
            outputs: self.outputs,
        }
    }
}
