//! Point at which a disturbance enters a twin.

/// Point at which a disturbance enters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(in crate::evid) enum Entry {
    /// Added to the rate of a state.
    State(usize),
    /// Added to an output, before its noise.
    Sensor(usize),
    /// Added to an input; only where there are no equations.
    Actuator(usize),
    /// Added to the logarithm of a parameter.
    Parameter(usize),
}

/// √(1 − a²), and 1 for a = 1: how much of σ comes anew at each step.
pub(in crate::evid) fn share(memory: f64) -> f64 {
    match 1.0 - memory * memory {
        s if s > 0.0 => s.sqrt(),
        _ => 1.0,
    }
}
