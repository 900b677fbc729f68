//! Worlds: any twin, moved by an integrator of their own, with departures that the twin does not know.
//!
//! A world shares with the twin the equations that the user wrote, and nothing else of this crate: neither its integrators nor its
//! effects nor `augment`.

mod black_box;
mod conditions;
mod equations;

pub use conditions::NuisanceKind;
pub(super) use conditions::{Conditions, Feedback};

use super::law::Departure;
use crate::record::{Drive, Signal};
use crate::twin::{Composed, Noise, Twin};

/// The truth of one record.
#[derive(Debug, Clone, Copy)]
pub(super) struct System<'s> {
    pub theta: &'s [f64],
    pub departures: &'s [Departure],
    pub conditions: &'s Conditions,
}

impl<'s> System<'s> {
    /// A system without departures.
    pub fn new(theta: &'s [f64], conditions: &'s Conditions) -> Self {
        let departures = &[];
        Self {
            theta,
            departures,
            conditions,
        }
    }
}

/// Everything random in one record, in two parts that can be drawn apart.
#[derive(Debug, Clone, Copy)]
pub(super) struct RecordNoise {
    /// Process noise, start, gaps.
    pub process: Noise,
    pub measurement: Noise,
    /// Sign of all noise: 1 or −1.
    pub sign: f64,
}

impl RecordNoise {
    /// Draws of one record.
    pub fn of(noise: Noise) -> Self {
        Self {
            process: noise.child("world process"),
            measurement: noise.child("world measurement"),
            sign: 1.0,
        }
    }

    /// The same process noise with other measurement noise.
    pub fn remeasured(self) -> Self {
        Self {
            measurement: self.measurement.child("again"),
            ..self
        }
    }

    /// Draws of what went before the record.
    fn earlier(self) -> Self {
        Self {
            process: self.process.child("earlier"),
            measurement: self.measurement.child("earlier"),
            ..self
        }
    }

    /// The same with all noise of the other sign.
    pub fn mirrored(self) -> Self {
        Self {
            sign: -self.sign,
            ..self
        }
    }
}

/// A record of a world, with what no sensor sees.
#[derive(Debug, Clone)]
pub(super) struct WorldRun {
    /// Inputs as commanded.
    pub drive: Drive,
    /// Outputs, NaN where one is missing.
    pub outputs: Signal,
    /// States at each sample; no columns for a black box.
    pub states: Signal,
    /// Rates of the states there, without departures.
    pub rates: Signal,
}

/// The equations of a twin; none of a simulator.
pub(super) fn equations(twin: &Twin) -> Option<&Composed> {
    twin.equations()
}

/// Makes a record of a twin's world; `None` where the system diverges.
pub(super) fn run(
    twin: &Twin,
    system: System<'_>,
    drive: &Drive,
    draws: RecordNoise,
) -> Option<WorldRun> {
    match equations(twin) {
        Some(equations) => equations::run(equations, system, drive, draws),
        None => black_box::run(twin, system, drive, draws),
    }
}
