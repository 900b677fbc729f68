//! The law of an effect: a function of the twin's signals, states, parameters or noise.
//!
//! A user's law is one of a single point. The twin calls it for several points at once, so that the loop over them is compiled with the
//! law inline.

use crate::twin::{
    Law, LawPlace, Layout, Now, ParameterChange, RateChange, SignalChange, StateLimit,
};
use smallvec::SmallVec;

/// Position along a sensor's signal at which the measurement noise enters.
pub(crate) const NOISE_ENTERS: u32 = 70;

/// Everything that a force may depend on.
#[derive(Debug, Clone, Copy)]
pub struct ForcePoint<'a> {
    /// The target's value.
    pub x: f64,
    /// The other state's value; 0 for a force without one.
    pub other: f64,
    /// Values that the law remembers; empty for a force without memory.
    pub memory: &'a [f64],
    /// Seconds from the first sample.
    pub t: f64,
    /// All states of the twin.
    pub states: &'a [f64],
    /// Inputs that act now, behind the actuator effects.
    pub u: &'a [f64],
    /// Parameters of the twin, bent by the parameter effects.
    pub theta: &'a [f64],
}

impl Law {
    /// Returns the kind of target.
    pub fn target(&self) -> TargetKind {
        match self {
            Self::Sensor(_)
            | Self::Reading(_)
            | Self::MeasurementNoise(_)
            | Self::Rounding(_)
            | Self::Outliers(_) => TargetKind::Sensor,
            Self::Actuator(_) => TargetKind::Actuator,
            Self::Force(_) | Self::Limit(_) | Self::ProcessNoise(_) => TargetKind::State,
            Self::Parameter(_) => TargetKind::Parameter,
        }
    }

    /// Returns whether only the noise changes, so that no free run moves.
    pub fn is_noise(&self) -> bool {
        matches!(
            self,
            Self::MeasurementNoise(_) | Self::ProcessNoise(_) | Self::Outliers(_)
        )
    }
}

/// The kind of thing that an effect bends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum TargetKind {
    /// An output; `sensor`, or `sensor1`… where there are several.
    Sensor,
    /// An input; `actuator`, or `actuator1`…
    Actuator,
    /// A state, by name.
    State,
    /// A parameter, by name.
    Parameter,
}

impl TargetKind {
    /// Returns the word for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sensor => "sensor",
            Self::Actuator => "actuator",
            Self::State => "state",
            Self::Parameter => "parameter",
        }
    }

    /// Returns whether it is a signal, which black boxes have, too.
    pub fn is_signal(self) -> bool {
        matches!(self, Self::Sensor | Self::Actuator)
    }
}

impl<F> SignalChange for F
where
    F: Fn(&[f64], &Now<'_>, &mut [f64], f64) -> f64 + Send + Sync,
{
    fn pass(
        &self,
        m: &[f64],
        now: &Now<'_>,
        on: &LawPlace,
        (at, x): (Layout, &mut [f64]),
        (p, y): (usize, &mut [f64]),
    ) {
        let (memory, target) = (on.memory.clone(), on.target);
        for (x, y) in at.each_mut(x).zip(y.chunks_exact_mut(p)) {
            y[target] = self(m, now, &mut x[memory.clone()], y[target]);
        }
    }

    fn peek(
        &self,
        m: &[f64],
        now: &Now<'_>,
        on: &LawPlace,
        (at, x): (Layout, &[f64]),
        (p, y): (usize, &mut [f64]),
    ) {
        let (memory, target) = (on.memory.clone(), on.target);
        let outputs = y.chunks_exact_mut(p);
        match memory.len() {
            0 => {
                for y in outputs {
                    y[target] = self(m, now, &mut [], y[target]);
                }
            }
            1 => {
                for (x, y) in at.each(x).zip(outputs) {
                    y[target] = self(m, now, &mut [x[memory.start]], y[target]);
                }
            }
            length => {
                // Short memories are copied without the heap.
                let mut copy = SmallVec::<[f64; 8]>::from_elem(0.0, length);
                for (x, y) in at.each(x).zip(outputs) {
                    copy.copy_from_slice(&x[memory.clone()]);
                    y[target] = self(m, now, &mut copy, y[target]);
                }
            }
        }
    }
}

impl<F> RateChange for F
where
    F: Fn(&[f64], &ForcePoint<'_>) -> f64 + Send + Sync,
{
    fn push(
        &self,
        m: &[f64],
        now: &Now<'_>,
        on: &LawPlace,
        (at, x): (Layout, &[f64]),
        dx: &mut [f64],
    ) {
        let points = x.chunks_exact(at.stride);
        for (all, rates) in points.zip(at.each_mut(dx)) {
            let states = &all[..at.states];
            let point = ForcePoint {
                x: states[on.target],
                other: on.other.map_or(0.0, |j| states[j]),
                memory: &all[on.memory.clone()],
                t: now.t,
                states,
                u: now.u,
                theta: now.theta,
            };
            rates[on.target] += self(m, &point);
        }
    }
}

impl<F> StateLimit for F
where
    F: Fn(&[f64], &mut f64, Option<&mut f64>) + Send + Sync,
{
    fn hold(&self, m: &[f64], on: &LawPlace, at: Layout, x: &mut [f64]) {
        let other = on.other.filter(|j| *j != on.target);
        for x in at.each_mut(x) {
            let mut value = x[on.target];
            self(m, &mut value, other.map(|j| &mut x[j]));
            x[on.target] = value;
        }
    }
}

impl<F> ParameterChange for F
where
    F: Fn(&[f64], f64, f64) -> f64 + Send + Sync,
{
    fn value(&self, m: &[f64], now: &Now<'_>, _: &[f64], value: f64) -> f64 {
        self(m, now.t, value)
    }
}
