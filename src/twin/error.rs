//! Errors of parameters, intervals, names and settings of a twin.

use crate::setting::did_you_mean;
use crate::twin::Interval;

/// Why a twin, its parameters, a point or a new setting cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TwinError {
    /// An interval whose ends are exchanged, equal or NaN.
    #[error("invalid interval [{low}, {high}]: low must be below high")]
    Interval {
        /// Lower end.
        low: f64,
        /// Upper end.
        high: f64,
    },
    /// No parameter at all.
    #[error("the twin has no parameter to estimate; declare or free at least one")]
    NoParameter,
    /// Two parameters, states, inputs or outputs of one name.
    #[error("duplicate {kind} name {name}; rename one")]
    Duplicate {
        /// "parameter", "state", "input" or "output".
        kind: &'static str,
        /// The name.
        name: String,
    },
    /// A name that files and the command line cannot tell apart from others.
    #[error("{kind} name \"{name}\" {problem}")]
    Name {
        /// "parameter", "state", "input" or "output".
        kind: &'static str,
        /// The name.
        name: String,
        /// What is wrong, and the remedy.
        problem: &'static str,
    },
    /// A prior or bounds with ends exchanged, or not finite.
    #[error("{what} of {name} is {interval}; write finite [low, high] with low < high")]
    Box {
        /// Parameter.
        name: String,
        /// "prior" or "bounds".
        what: &'static str,
        /// What was given.
        interval: Interval,
    },
    /// A prior that leaves the physical bounds.
    #[error(
        "prior {prior} of {name} leaves its bounds {bounds}; shrink the prior or widen the bounds"
    )]
    PriorOutside {
        /// Parameter.
        name: String,
        /// The prior box.
        prior: Interval,
        /// The physical bounds.
        bounds: Interval,
    },
    /// A point with too many or too few numbers.
    #[error("{given} values for {expected} parameters ({names}); give one value for each")]
    Length {
        /// Values given.
        given: usize,
        /// Values needed.
        expected: usize,
        /// Names of the parameters.
        names: String,
    },
    /// A value outside the physical bounds, or not a number.
    #[error("{name} = {value} is outside its bounds {bounds}; choose a value inside")]
    OutOfBounds {
        /// Parameter.
        name: String,
        /// The value.
        value: f64,
        /// Its bounds.
        bounds: Interval,
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
    #[error("[{table}] names {name}{}, the twin has {known}; use one of these", did_you_mean(name, known.split(", ")))]
    UnknownIn {
        /// Table of the study file.
        table: &'static str,
        /// The name.
        name: String,
        /// Known names.
        known: String,
    },
    /// Limits, noise levels or starts of a black box.
    #[error(
        "[{0}] needs the twin's equations, which a black box does not show; remove the table or implement StateSpace"
    )]
    BlackBox(&'static str),
    /// A noise level or start that the twin cannot have.
    #[error("[{table}] {name} = {value}; {remedy}")]
    Value {
        /// Table of the study file.
        table: &'static str,
        /// Name.
        name: String,
        /// Value.
        value: f64,
        /// What to write.
        remedy: &'static str,
    },
    /// An unknown start or noise level without a prior.
    #[error("no prior for the unknown {0}; add [prior] \"{0}\" = [low, high]")]
    NoPrior(String),
}
