//! The error of this room.

use crate::setting::{did_you_mean, number};
use crate::twin::Interval;
use std::path::PathBuf;

/// Error of an effect: its file, its names, or its place in a twin.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EffectError {
    /// The effect file cannot be read.
    #[error("{}: {error}; give the path of an effect file", path.display())]
    Io {
        /// File.
        path: PathBuf,
        /// Error of the system.
        error: std::io::Error,
    },
    /// The text is no list of effects: bad TOML, an unknown id, an unknown or a missing key.
    #[error(
        "{}, line {line}: {problem}; write [[effect]], then id, target and magnitudes = {{ name = value }}",
        path.display()
    )]
    Text {
        /// File; `effects` for a text that came without one.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// The problem there.
        problem: String,
    },
    /// An id that neither the library nor the study has.
    #[error("unknown effect id \"{id}\"{}; choose one of {known}", did_you_mean(id, known.split(", ")))]
    Unknown {
        /// The id.
        id: String,
        /// Known ids.
        known: String,
    },
    /// A text that is not `id@target`.
    #[error("\"{text}\" is no effect at a target; write id@target")]
    Key {
        /// The text.
        text: String,
    },
    /// The other state of a law between two states is missing.
    #[error("effect {id} acts between two states; add {key} = \"the other state\"")]
    NoOther {
        /// Effect.
        id: String,
        /// `from` or `to`.
        key: &'static str,
    },
    /// Another state is given to an effect that has none, or under the wrong key.
    #[error("effect {id} has no {key}; remove {key} = \"{state}\"")]
    Other {
        /// Effect.
        id: String,
        /// `from` or `to`.
        key: &'static str,
        /// The state.
        state: String,
    },
    /// The target, or the other state, does not exist.
    #[error("effect {id}: the twin has no {what} \"{name}\"{}; choose one of {known}", did_you_mean(name, known.split(", ")))]
    Target {
        /// Effect.
        id: String,
        /// Kind of target.
        what: &'static str,
        /// The name.
        name: String,
        /// Names of this kind.
        known: String,
    },
    /// A dynamics effect on a black box.
    #[error(
        "effect {id} bends the equations, which a black-box twin does not show; only sensor and actuator effects can be added"
    )]
    BlackBox {
        /// Effect.
        id: String,
    },
    /// A magnitude that the effect does not have.
    #[error("effect {id} has no magnitude \"{name}\"{}; it has {known}", did_you_mean(name, known.split(", ")))]
    Magnitude {
        /// Effect.
        id: String,
        /// The name.
        name: String,
        /// Its magnitudes.
        known: String,
    },
    /// The same effect on the same target twice.
    #[error("effect {id} on {target} is given twice; give it once")]
    Duplicate {
        /// Effect.
        id: String,
        /// Target.
        target: String,
    },
    /// An effect between a state and itself.
    #[error("effect {id} goes from {target} to itself; name another state")]
    Itself {
        /// Effect.
        id: String,
        /// Target.
        target: String,
    },
    /// A memory after the noise, where the framework keeps none.
    #[error("effect {id} remembers and stands after the noise; give it an order below {limit}")]
    Memory {
        /// Effect.
        id: String,
        /// The order at which the noise enters.
        limit: u32,
    },
    /// A magnitude out of its limits.
    #[error("effect {id}: {name} = {} is outside {limits}; choose a value inside", number(*value))]
    Value {
        /// Effect.
        id: String,
        /// Magnitude.
        name: String,
        /// The value.
        value: f64,
        /// Its limits.
        limits: Interval,
    },
}
