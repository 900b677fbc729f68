use crate::setting::number;
use std::error::Error;

/// A computation that has no result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MathError {
    /// A quantile of no values, or of NaN.
    #[error("no values, or NaN among them, have no order; remove failed evaluations first")]
    NoOrder,
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
    /// NaN, infinity or overflow in a matrix or right side.
    #[error(
        "the matrix or right side has an entry that is not finite, or overflows; check the signals behind it"
    )]
    NotFinite,
    /// Rounding or the bounds leave no room for a difference.
    #[error(
        "a step of {} cannot be taken from parameter {index} = {}; choose about 1e-5 of the parameter's scale, and bounds wider than that",
        number(*step), number(*value)
    )]
    Step {
        /// The parameter.
        index: usize,
        /// Its value.
        value: f64,
        /// The step.
        step: f64,
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
}
