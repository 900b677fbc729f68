//! The truth of one trial, drawn with its records.
//!
//! | file | does |
//! |---|---|
//! | `prior.rs` | draws θ and the conditions of a record |
//! | `sizing.rs` | finds the size at which a departure has the information that it is to have |
//! | `imitators.rs` | finds the listed effects, of those that worlds can have, that a record cannot tell from a departure |
//! | `sampler.rs` | draws a whole truth |

#[cfg(test)]
mod fixture;
mod imitators;
mod prior;
mod sampler;
mod sizing;

pub(super) use sampler::{Extra, TruthSampler};

use super::Kind;
use super::law::Departure;
use super::world::Conditions;
use crate::evaluate::EvaluateError;
use serde::{Deserialize, Serialize};

/// A listed effect that is no right answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct NearestEffect {
    /// `id@target`.
    pub effect: String,
    /// Nats of the departure that it leaves at best.
    pub nats: f64,
}

/// Difference between system and twin in a trial: the key that is sealed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Truth {
    pub trial: usize,
    pub kind: Kind,
    /// True parameters of the twin.
    pub theta: Vec<f64>,
    pub(super) conditions: Conditions,
    pub(super) departures: Vec<Departure>,
    /// Names of the departures: `id@target`, or the family of a random law and its place.
    pub labels: Vec<String>,
    /// Expressions of random laws, in standardised arguments.
    pub formulas: Vec<String>,
    /// Listed effects that are there, as `id@target`.
    pub effects: Vec<String>,
    /// For each departure the listed effects that are a right answer.
    pub right: Vec<Vec<String>>,
    /// The listed effect nearest to a departure that is no right answer; none for a black box, and where nothing is missing.
    pub rival: Option<NearestEffect>,
    /// Places where the twin is wrong.
    pub targets: Vec<String>,
    /// These, and the places that mean the same by the structure of the equations.
    pub places: Vec<String>,
    /// Expected information in nats; of two departures, that of the weaker one without what the other explains. None where nothing is
    /// missing.
    pub information: Option<f64>,
    /// Nats by which the twin's own integration step shows.
    pub step: f64,
    /// Draws that were given up before this one.
    pub redraws: u64,
}

/// Reason for which a draw was given up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Reject {
    Diverged,
    Still,
    NoFilter,
    NoLaw,
    NoNuisance,
    TooWeak,
    TooAlike,
}

impl Reject {
    /// Returns what became of the draw, after its count.
    pub fn text(self) -> &'static str {
        match self {
            Self::Diverged => "diverged",
            Self::Still => "had an output that never moves",
            Self::NoFilter => "could not be filtered",
            Self::NoLaw => "had no law that could be made",
            Self::NoNuisance => "could have none of these nuisances",
            Self::TooWeak => "did not show in the outputs, or diverged before they did",
            Self::TooAlike => "had two departures of which one explains or hides the other",
        }
    }
}

/// End of a draw without a truth: it was given up, or nothing can be drawn any more.
#[derive(Debug)]
pub(super) enum DrawEnd {
    Rejected(Reject),
    Failed(EvaluateError),
}

impl From<Reject> for DrawEnd {
    fn from(reject: Reject) -> Self {
        Self::Rejected(reject)
    }
}

impl<E: Into<EvaluateError>> From<E> for DrawEnd {
    fn from(error: E) -> Self {
        Self::Failed(error.into())
    }
}
