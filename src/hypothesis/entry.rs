//! Points at which disturbances and unknown functions enter a twin.

use super::basis::{Of, TERMS};
use crate::twin::{Parameter, ParameterSpace, Role};

/// Point at which a disturbance or a function enters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Entry {
    /// Added to the rate of a state.
    State(usize),
    /// Added to an output, before its noise.
    Sensor(usize),
    /// Added to an input; only where there are no equations.
    Actuator(usize),
    /// Added to the logarithm of a parameter.
    Parameter(usize),
}

/// Standard deviation of a disturbance at the first sample, in units of σ: it began long before, unless it forgets nothing.
pub(crate) fn started(memory: f64) -> f64 {
    if memory < 1.0 { 1.0 } else { 0.0 }
}

/// √(1 − a²), and 1 for a = 1: how much of σ comes anew at each step.
pub(crate) fn share(memory: f64) -> f64 {
    match 1.0 - memory * memory {
        s if s > 0.0 => s.sqrt(),
        _ => 1.0,
    }
}

/// Largest change of the logarithm of a parameter: e⁵ is beyond any that a record could show.
pub(super) const LARGEST: f64 = 5.0;

/// A function, where it enters, and the range that it is drawn over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Entered {
    /// A sensor or a parameter.
    pub entry: Entry,
    pub of: Of,
    pub ends: (f64, f64),
}

/// Parameters with a function's coefficients behind them.
pub(super) fn with_coefficients(space: &ParameterSpace) -> ParameterSpace {
    let coefficients = (1..=TERMS).map(|k| {
        Parameter::new(&format!("function/{k}"), "", -1.0, 1.0).with_role(Role::Magnitude)
    });
    ParameterSpace::new(space.iter().cloned().chain(coefficients))
}
