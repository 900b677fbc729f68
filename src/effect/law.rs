//! The law of an effect: a function of the twin's signals, states, parameters or noise.

use crate::twin::{NoiseLaw, OutlierLaw, ParameterChange, RateChange, SignalChange, StateLimit};
use std::fmt;
use std::sync::Arc;

/// Position along a sensor's signal at which the measurement noise enters.
pub(crate) const NOISE_ENTERS: u32 = 70;

/// Time of a sample, and the step, in seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instant {
    /// Seconds from the first sample.
    pub t: f64,
    /// Step Δt.
    pub dt: f64,
}

/// Everything that a force may depend on.
#[derive(Debug, Clone, Copy)]
pub struct ForcePoint<'a> {
    /// The target's value.
    pub x: f64,
    /// The other state's value; 0 for a force without one.
    pub other: f64,
    /// Seconds from the first sample.
    pub t: f64,
    /// All states of the twin.
    pub states: &'a [f64],
    /// Inputs that act now, behind the actuator effects.
    pub u: &'a [f64],
    /// Parameters of the twin, bent by the parameter effects.
    pub theta: &'a [f64],
}

/// The law of an effect: a function of its magnitudes and of what it bends, over several points at once.
#[derive(Clone)]
#[non_exhaustive]
pub(crate) enum Law {
    /// An output signal.
    Sensor(Arc<dyn SignalChange>),
    /// An input signal.
    Actuator(Arc<dyn SignalChange>),
    /// The rate of a state.
    Force(Arc<dyn RateChange>),
    /// A limit on a state, after each step.
    Limit(Arc<dyn StateLimit>),
    /// A parameter over time.
    Parameter(Arc<dyn ParameterChange>),
    /// The noise of an output: a standard deviation that joins the twin's own in quadrature.
    MeasurementNoise(Arc<NoiseLaw>),
    /// The noise of a state.
    ProcessNoise(Arc<NoiseLaw>),
    /// Rounding of an output, after its noise: the law is the step.
    Rounding(Arc<NoiseLaw>),
    /// Rare large errors of an output, after everything else.
    Outliers(Arc<OutlierLaw>),
}

impl Law {
    /// Returns the kind of target.
    pub fn target(&self) -> TargetKind {
        match self {
            Self::Sensor(_) | Self::MeasurementNoise(_) | Self::Rounding(_) | Self::Outliers(_) => {
                TargetKind::Sensor
            }
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

impl fmt::Debug for Law {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Sensor(_) => "Sensor",
            Self::Actuator(_) => "Actuator",
            Self::Force(_) => "Force",
            Self::Limit(_) => "Limit",
            Self::Parameter(_) => "Parameter",
            Self::MeasurementNoise(_) => "MeasurementNoise",
            Self::ProcessNoise(_) => "ProcessNoise",
            Self::Rounding(_) => "Rounding",
            Self::Outliers(_) => "Outliers",
        })
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
