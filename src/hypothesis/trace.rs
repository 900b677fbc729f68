//! Traces that signals leave behind, and where a function of one enters.

use super::basis::Of;
use crate::effect::{clamp, lag};
use crate::twin::{Entry, Remember};

/// Value that a signal leaves behind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Trace {
    /// That of a first-order lag of so many seconds.
    Lag(f64),
    /// That of a play: it follows at this distance.
    Play(f64),
}

impl Trace {
    /// The value after z, the signal being s.
    pub fn step(self, mut z: f64, s: f64, dt: f64) -> f64 {
        match self {
            Self::Lag(tau) => lag(tau, dt, &mut z, s),
            Self::Play(distance) => clamp(z, s - distance, s + distance),
        }
    }

    /// The trace of a list of values.
    pub fn of(self, values: &[f64], dt: f64) -> Vec<f64> {
        let first = values.first().copied().unwrap_or(f64::NAN);
        let follow = |z: &mut f64, s: &f64| {
            *z = self.step(*z, *s, dt);
            Some(*z)
        };
        values.iter().scan(first, follow).collect()
    }
}

impl Remember for Trace {
    fn next(&self, _: &[f64], dt: f64, value: f64, memory: &mut [f64]) {
        memory[0] = self.step(memory[0], value, dt);
    }
}

/// A function of a trace before it is a part of a twin: where it enters, of what, and the range of the trace.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Trail {
    pub entry: Entry,
    pub of: Of,
    pub trace: Trace,
    pub ends: (f64, f64),
}

impl Trail {
    pub fn new(entry: Entry, of: Of, trace: Trace, ends: (f64, f64)) -> Self {
        Self {
            entry,
            of,
            trace,
            ends,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A filter's points may leave all bounds: a law then gives a number or NaN, and never ends the program.
    #[test]
    fn traces_follow_and_stand_nan() {
        assert_eq!(
            Trace::Play(0.5).of(&[1.0, 1.2, 2.0, 1.8], 0.1),
            [1.0, 1.0, 1.5, 1.5]
        );
        let lagged = Trace::Lag(0.1).step(0.0, 1.0, 0.1);
        assert!((lagged - (1.0 - (-1.0_f64).exp())).abs() < 1e-15);
        for trace in [Trace::Lag(1.0), Trace::Play(0.5)] {
            let _ = trace.step(1.0, f64::NAN, 0.1);
        }
    }
}
