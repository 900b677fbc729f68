//! Errors of a filter.
use crate::math::MathError;
use crate::progress::Cancelled;
use crate::record::RecordError;
use crate::setting::{SettingError, number};
use crate::twin::{SimulationError, TwinError};

/// Error of a filter. [`Diverged`](Self::Diverged), [`NoSpread`](Self::NoSpread) and a twin that
/// refuses θ cost this θ alone; the rest ends the work.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FilterError {
    /// The record does not fit the twin.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// θ does not fit the twin.
    #[error(transparent)]
    Parameter(#[from] TwinError),
    /// The twin cannot be simulated at this θ.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// A mean or variance left the finite numbers.
    #[error("the filter diverged at t = {} s; these parameters are not for this record", number(*at))]
    Diverged {
        /// Time in seconds.
        at: f64,
    },
    /// The covariance of an innovation has no inverse.
    #[error(
        "the outputs at t = {} s are predicted without any uncertainty; give one of them measurement noise, \
         or raise noise_floor",
        number(*at)
    )]
    NoSpread {
        /// Time in seconds.
        at: f64,
    },
    /// A setting that cannot be used.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// An initial covariance of another size, or none at all.
    #[error(
        "start_covariance is {rows} × {columns}; give a symmetric, non-negative {states} × {states} matrix"
    )]
    StartCovariance {
        /// Rows that were given.
        rows: usize,
        /// Columns that were given.
        columns: usize,
        /// States of the twin.
        states: usize,
    },
    /// The work was stopped.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// No differences could be taken around θ.
    #[error(transparent)]
    Difference(#[from] MathError),
}

impl FilterError {
    /// Returns whether another θ may do: the search goes on elsewhere.
    pub fn is_recoverable(&self) -> bool {
        match self {
            Self::Diverged { .. } | Self::NoSpread { .. } => true,
            Self::Simulation(error) => error.costs_one_run(),
            _ => false,
        }
    }

    /// Returns whether the work was stopped, in a search of the filter's own, too.
    pub(crate) fn is_cancelled(&self) -> bool {
        stops(self)
    }
}

/// Returns whether an error is that of work that was stopped, whatever is around it.
fn stops(error: &(dyn std::error::Error + 'static)) -> bool {
    let inner = match (error.downcast_ref(), error.downcast_ref()) {
        (Some(FilterError::Cancelled(_)), _) => return true,
        (Some(FilterError::Simulation(error)), _) => return error.is_stopped(),
        (Some(FilterError::Difference(MathError::Fatal(inner))), _)
        | (_, Some(MathError::Fatal(inner))) => Some(&**inner),
        _ => None,
    };
    error.is::<Cancelled>()
        || inner.is_some_and(|inner| stops(inner))
        || error.source().is_some_and(stops)
}

/// An error that only rules out one θ is no error of a search: `None`.
pub(crate) fn recoverable<T>(result: Result<T, FilterError>) -> Result<Option<T>, FilterError> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(error) if error.is_recoverable() => Ok(None),
        Err(error) => Err(error),
    }
}

impl From<FilterError> for MathError {
    fn from(error: FilterError) -> Self {
        if error.is_recoverable() {
            Self::rejected(error)
        } else {
            Self::fatal(error)
        }
    }
}
