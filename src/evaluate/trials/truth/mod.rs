//! The truth of one trial, drawn with its records.
//!
//! | file | does |
//! |---|---|
//! | `prior.rs` | draws θ and the conditions of a record |
//! | `sizing.rs` | finds the size at which a departure has the information that it is to have |
//! | `sampler.rs` | draws a whole truth |

mod prior;
mod sampler;
mod sizing;

pub(super) use sampler::{Drawn, Extra, TruthSampler};

use super::Kind;
use super::law::Departure;
use super::world::Conditions;
use serde::{Deserialize, Serialize};

/// Difference between system and twin in a trial: the key that is sealed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Truth {
    pub trial: usize,
    pub kind: Kind,
    /// True parameters of the twin.
    pub theta: Vec<f64>,
    pub conditions: Conditions,
    pub departures: Vec<Departure>,
    /// Names of the departures: `id@target`, or the family of a random law and its place.
    pub labels: Vec<String>,
    /// Expressions of random laws, in standardised arguments.
    pub formulas: Vec<String>,
    /// Listed effects that are there, as `id@target`.
    pub effects: Vec<String>,
    /// For each departure the listed effects that are a right answer.
    pub right: Vec<Vec<String>>,
    /// Places where the twin is wrong.
    pub targets: Vec<String>,
    /// Expected information in nats; of two departures, that of the weaker one. None where nothing is missing.
    pub information: Option<f64>,
    /// Nats by which the twin's own integration step shows.
    pub step: f64,
    /// Draws that were given up before this one.
    pub redraws: u64,
}
