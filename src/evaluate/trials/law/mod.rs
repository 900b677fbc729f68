//! Laws of departures, written once more: nothing here uses the library of effects.
//!
//! | file | laws |
//! |---|---|
//! | `signal.rs` | distortions of a signal on its way from a sensor or to an actuator |
//! | `force.rs` | terms in the rate of a state, changes of a parameter over time |
//! | `random.rs`, `functions.rs` | functions that are drawn anew for each trial, and the halves of their families |

mod force;
mod functions;
mod random;
mod signal;

pub(super) use force::{ForceDeparture, ParameterDeparture, Wave};
pub use random::Families;
pub(super) use random::{Argument, LawFamily, LawVariable, RandomLaw};
pub(super) use signal::SignalDeparture;

use crate::effect::TargetKind;
use serde::{Deserialize, Serialize};

/// Place where a system differs from its twin; indices are those of the twin's outline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum DeparturePlace {
    State(usize),
    Actuator(usize),
    Sensor(usize),
    Parameter(usize),
}

impl DeparturePlace {
    /// Kind of place, as the library of effects has it.
    pub fn kind(self) -> TargetKind {
        match self {
            Self::State(_) => TargetKind::State,
            Self::Actuator(_) => TargetKind::Actuator,
            Self::Sensor(_) => TargetKind::Sensor,
            Self::Parameter(_) => TargetKind::Parameter,
        }
    }
}

/// Law of a departure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum DepartureLaw {
    /// Distortion of a sensor's or an actuator's signal.
    Signal(SignalDeparture),
    /// Term in the rate of a state.
    Force(ForceDeparture),
    /// The excess of a state over a level is lost, but for a part that another state takes.
    Ceiling {
        level: f64,
        spill: f64,
        to: Option<usize>,
        softness: f64,
    },
    /// Factor on a parameter.
    Parameter(ParameterDeparture),
    /// Added function: of a rate, of a signal, or of the logarithm of a parameter.
    Random(RandomLaw),
}

impl DepartureLaw {
    /// Returns true for a law that acts on the noisy reading, not on the signal before its noise.
    pub fn is_of_readings(&self) -> bool {
        matches!(
            self,
            Self::Signal(SignalDeparture::Saturation { .. } | SignalDeparture::Quantization { .. })
        )
    }

    /// A signal behind a sensor's or actuator's law; `now.own` is the signal before it. Other laws leave it alone.
    pub fn through(&self, now: &Moment<'_>, dt: f64, memory: &mut Vec<f64>) -> f64 {
        match self {
            Self::Signal(law) => law.at(now.t, dt, memory, now.own),
            Self::Random(law) => {
                law.remember(now, dt, memory);
                now.own + law.at(now, memory)
            }
            Self::Force(_) | Self::Ceiling { .. } | Self::Parameter(_) => now.own,
        }
    }

    /// A factor on a parameter, which is `now.own`; 1 of other laws.
    pub fn factor(&self, now: &Moment<'_>, dt: f64, memory: &mut Vec<f64>) -> f64 {
        match self {
            Self::Parameter(law) => law.at(now.t),
            Self::Random(law) => {
                law.remember(now, dt, memory);
                law.at(now, memory).clamp(-5.0, 5.0).exp()
            }
            Self::Signal(_) | Self::Force(_) | Self::Ceiling { .. } => 1.0,
        }
    }
}

/// One difference between the system and its twin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Departure {
    pub place: DeparturePlace,
    pub law: DepartureLaw,
}

/// Values that a law may depend on at one instant.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moment<'a> {
    /// Time in seconds.
    pub t: f64,
    /// States; empty for a black box.
    pub x: &'a [f64],
    /// Inputs as commanded.
    pub u: &'a [f64],
    /// Signal at the place itself.
    pub own: f64,
}

impl<'a> Moment<'a> {
    /// An instant at no place.
    pub fn new(t: f64, x: &'a [f64], u: &'a [f64]) -> Self {
        let own = 0.0;
        Self { t, x, u, own }
    }

    /// The same at a place with this signal.
    pub fn at(self, own: f64) -> Self {
        Self { own, ..self }
    }
}

/// Part of `v` above zero; with a knee, rounded over about that width.
pub(super) fn above(v: f64, knee: f64) -> f64 {
    if knee > 0.0 {
        // Far out, exp would overflow and the knee is not felt.
        match v / knee {
            z if z > 30.0 => v,
            z => knee * z.exp().ln_1p(),
        }
    } else {
        v.max(0.0)
    }
}
