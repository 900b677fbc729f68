use crate::setting::{SettingError, number};
use std::error::Error;

/// A computation that has no result: its input is at fault, or what it evaluates.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MathError {
    /// A setting that cannot be used.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// A vector is not as long as θ.
    #[error("{name} has {length} entries for {dimension} parameters; give one for each")]
    Length {
        /// The vector.
        name: &'static str,
        /// Its length.
        length: usize,
        /// The number of parameters.
        dimension: usize,
    },
    /// A probability outside [0, 1].
    #[error("probability = {}; it must lie in [0, 1]", number(*.0))]
    Probability(f64),
    /// A level outside (0, 1).
    #[error("level = {}; it must lie strictly between 0 and 1, such as 0.95", number(*.0))]
    Level(f64),
    /// More successes than trials.
    #[error("count = {count} of {of}; there cannot be more successes than trials")]
    Count {
        /// Successes.
        count: u64,
        /// Trials.
        of: u64,
    },
    /// A quantile of nothing.
    #[error("a quantile of no values was asked for; at least one is needed")]
    NoValues,
    /// A value that has no place in an order.
    #[error(
        "values[{index}] is NaN and has no place in the order; remove failed evaluations first"
    )]
    NotANumber {
        /// Its position.
        index: usize,
    },
    /// Fewer than two draws for a covariance.
    #[error("samples has {0} draws; a covariance needs at least 2, a good one 16 for each feature")]
    TooFewDraws(usize),
    /// NaN or infinity among draws.
    #[error("samples[{row}, {column}] = {} (draw, feature); leave out draws that diverged", number(*value))]
    Draw {
        /// The draw.
        row: usize,
        /// The feature.
        column: usize,
        /// Its value.
        value: f64,
    },
    /// Features none of which varies.
    #[error(
        "none of {features} features varies over {draws} draws; is the twin's noise on, and its seed another for each draw?"
    )]
    NoVariance {
        /// Number of features.
        features: usize,
        /// Number of draws.
        draws: usize,
    },
    /// An ε that is not positive.
    #[error("epsilon = {}; it must be positive and finite, such as 1e-8", number(*.0))]
    Epsilon(f64),
    /// A decomposition that overflowed.
    #[error("the covariance could not be decomposed; features near 1e300 need smaller units")]
    NotDecomposed,
    /// Rows that do not fit the regressors.
    #[error("{what} has {rows} rows, the regressors ask for {expected}")]
    Shape {
        /// The matrix.
        what: &'static str,
        /// Its rows.
        rows: usize,
        /// The rows that fit.
        expected: usize,
    },
    /// A right side that does not fit the matrix.
    #[error("matrix has {rows} rows, the right side {length} entries; both need the same number")]
    RightSide {
        /// Rows of the matrix.
        rows: usize,
        /// Length of the right side.
        length: usize,
    },
    /// A ridge out of range.
    #[error("ridge = {}; it must lie in (0, 0.01], such as 1e-10", number(*.0))]
    Ridge(f64),
    /// A cutoff that is no fraction.
    #[error("relative_cutoff = {}; choose one in [0, 1), such as 1e-8", number(*.0))]
    Cutoff(f64),
    /// NaN or infinity in a matrix or right side.
    #[error(
        "the matrix or right side has an entry that is not finite, or overflows; check the signals behind it"
    )]
    NotFinite,
    /// A Gram matrix of other regressors.
    #[error("the Gram matrix is not positive semi-definite; it must be ΦᵀΦ of the same regressors")]
    NotGram,
    /// A step of a difference that is not positive, or too small beside its parameter.
    #[error(
        "step = {} of parameter {index} cannot be taken; choose about 1e-5 of the parameter's scale",
        number(*step)
    )]
    Step {
        /// The parameter.
        index: usize,
        /// The step.
        step: f64,
    },
    /// θ outside of its bounds.
    #[error(
        "parameter {index} = {} is outside of its bounds [{}, {}]; clamp it first",
        number(*value), number(*lower), number(*upper)
    )]
    Outside {
        /// The parameter.
        index: usize,
        /// Its value.
        value: f64,
        /// Its lower bound.
        lower: f64,
        /// Its upper bound.
        upper: f64,
    },
    /// Bounds that leave a parameter no room.
    #[error("parameter {index} is held at {} by its bounds; take it out of θ or widen them", number(*value))]
    NoRoom {
        /// The parameter.
        index: usize,
        /// Its only value.
        value: f64,
    },
    /// Values that do not fit the points of a stencil.
    #[error(
        "{values} values for {points} points, or of unequal lengths; give one for each point, all equally long"
    )]
    Values {
        /// Points of the stencil.
        points: usize,
        /// Values that were given.
        values: usize,
    },
    /// Not as many lower as upper bounds.
    #[error("{lower} lower and {upper} upper bounds; give one of each for every parameter")]
    BoundCounts {
        /// Number of lower bounds.
        lower: usize,
        /// Number of upper bounds.
        upper: usize,
    },
    /// An interval that holds no number.
    #[error(
        "parameter {index} has the bounds [{}, {}]; the lower must be at most the upper",
        number(*lower), number(*upper)
    )]
    EmptyInterval {
        /// The parameter.
        index: usize,
        /// Its lower bound.
        lower: f64,
        /// Its upper bound.
        upper: f64,
    },
    /// A parameter without finite bounds where points are spread over a box.
    #[error(
        "parameter {index} has no finite bounds; points cannot be spread over it, give it both"
    )]
    Unbounded {
        /// The parameter.
        index: usize,
    },
    /// No value at *this* θ, as where the twin diverged. A search goes on elsewhere.
    #[error("no value at this point: {0}")]
    Rejected(#[source] Box<dyn Error + Send + Sync>),
    /// No value at the start of a search.
    #[error("the search cannot begin at its start: {0}; start elsewhere")]
    Start(#[source] Box<dyn Error + Send + Sync>),
    /// No value at any θ, or a cancelled evaluation. The search ends.
    #[error(transparent)]
    Fatal(Box<dyn Error + Send + Sync>),
}

impl MathError {
    /// Creates [`Rejected`](Self::Rejected) from an error or a message.
    pub(crate) fn rejected(cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::Rejected(cause.into())
    }

    /// Creates [`Fatal`](Self::Fatal) from an error or a message.
    pub(crate) fn fatal(cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::Fatal(cause.into())
    }

    /// Fails unless `length` is `dimension`.
    pub(crate) fn check_length(
        name: &'static str,
        length: usize,
        dimension: usize,
    ) -> Result<(), Self> {
        if length == dimension {
            return Ok(());
        }
        Err(Self::Length {
            name,
            length,
            dimension,
        })
    }
}
