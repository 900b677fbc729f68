//! Errors of a twin's parameters, names, settings and effects, and of its simulations.

use crate::progress::Cancelled;
use crate::setting::{count, did_you_mean, number};
use std::path::PathBuf;

/// A fault in a twin, its parameters, a point, a new setting, or an effect on it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TwinError {
    /// An interval whose ends are exchanged, equal or NaN.
    #[error("invalid interval [{}, {}]; low must be below high", number(*low), number(*high))]
    Interval {
        /// Lower end.
        low: f64,
        /// Upper end.
        high: f64,
    },
    /// A name, a prior or bounds that cannot be: what is wrong, and the remedy.
    #[error("{0}")]
    Declaration(String),
    /// A parameter with a prior or bounds that it cannot have.
    #[error("{problem}")]
    Parameter {
        /// Name.
        name: String,
        /// Problem and remedy.
        problem: String,
    },
    /// A point with too many or too few numbers.
    #[error("{} for {} ({names}); give one value for each", count(*given, "value"), count(*expected, "parameter"))]
    Length {
        /// Values given.
        given: usize,
        /// Values needed.
        expected: usize,
        /// Names of the parameters.
        names: String,
    },
    /// A name that no parameter has.
    #[error("no parameter is called {name}{}; there are {names}", did_you_mean(name, names.split(", ")))]
    Unknown {
        /// The name.
        name: String,
        /// The known names.
        names: String,
    },
    /// A name in a study file's table that the twin does not have.
    #[error("{table} names {name}{}, the twin has {known}; use one of these", did_you_mean(name, known.split(", ")))]
    UnknownIn {
        /// Table of the study file.
        table: &'static str,
        /// The name.
        name: String,
        /// Known names.
        known: String,
    },
    /// Limits, noise levels or starts of a black box; [`StateSpace`](crate::twin::StateSpace) shows equations.
    #[error(
        "{0} needs the twin's equations, which a black box does not show; remove the table or show them"
    )]
    BlackBox(&'static str),
    /// A noise level or start that the twin cannot have.
    #[error("{table} {name} = {}; {remedy}", number(*value))]
    Value {
        /// Table of the study file.
        table: &'static str,
        /// Name.
        name: String,
        /// Value.
        value: f64,
        /// Remedy.
        remedy: &'static str,
    },
    /// States that start at different times.
    #[error(
        "start {name}: at = {}, and {} for another state; give all the same at, or one of them alone",
        number(*at),
        number(*other)
    )]
    Begins {
        /// State.
        name: String,
        /// Its time, in seconds.
        at: f64,
        /// Time of a state before it.
        other: f64,
    },
    /// An unknown start or noise level without a prior.
    #[error("no prior for the unknown {0}; give it one, from low to high")]
    NoPrior(String),
    /// The effect file cannot be read.
    #[error("{}: {error}; give the path of an effect file", path.display())]
    EffectFile {
        /// File.
        path: PathBuf,
        /// Message of the system.
        error: String,
    },
    /// The text is no list of effects: bad TOML, an unknown id, an unknown or a missing key.
    #[error(
        "{}, line {line}: {problem}; an effect has id, target and magnitudes = {{ name = value }}",
        path.display()
    )]
    EffectText {
        /// File; `effects` for a text that came without one.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// The problem there.
        problem: String,
    },
    /// An effect that the twin cannot have.
    #[error("{problem}")]
    Effect {
        /// Key of the effect's table that is wrong: `id`, `target`, `from`, `to` or a magnitude.
        key: String,
        /// Problem and remedy.
        problem: String,
    },
}

impl TwinError {
    /// An error at a key of an effect's table.
    pub(crate) fn effect(key: &str, problem: impl Into<String>) -> Self {
        Self::Effect {
            key: key.into(),
            problem: problem.into(),
        }
    }
}

/// A simulation without outputs.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulationError {
    /// A trajectory that left the finite numbers: these parameters are not for this input.
    #[error("the simulation diverged at t = {} s", number(*at))]
    Diverged {
        /// Time of the first non-finite value, in seconds.
        at: f64,
    },
    /// A run that failed for another reason, such as a solver that gave up; others may work.
    #[error("this simulation failed: {0}")]
    Failed(Box<dyn std::error::Error + Send + Sync>),
    /// A simulator that does not work at all; no other parameters will help.
    #[error("the simulator failed: {0}")]
    Fatal(Box<dyn std::error::Error + Send + Sync>),
}

impl SimulationError {
    /// A fatal error from a message.
    pub fn fatal(message: impl Into<String>) -> Self {
        Self::Fatal(message.into().into())
    }

    /// A fatal error from an error.
    pub(crate) fn of(error: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self::Fatal(error.into())
    }

    /// A run that is given up as the work is to stop.
    pub(crate) fn stopped() -> Self {
        Self::Fatal(Cancelled.into())
    }

    pub(crate) fn is_stopped(&self) -> bool {
        matches!(self, Self::Fatal(inner) if inner.is::<Cancelled>())
    }

    /// Tells whether only this run is lost: a search goes on elsewhere, a draw is drawn again.
    pub fn costs_one_run(&self) -> bool {
        matches!(self, Self::Diverged { .. } | Self::Failed(_))
    }
}
