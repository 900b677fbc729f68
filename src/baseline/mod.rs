//! What the estimator is compared with: the prediction-error method, the dual Kalman filter, and their starts.
//!
//! | to … | look at |
//! |---|---|
//! | fit the noise-free output, six steps as in the paper or to convergence | [`PredictionError`] |
//! | track θ along the record | [`DualFilter`] |
//! | choose where they start | [`Initialisation`] |

mod dual_ekf;
mod initialisation;
mod prediction_error;

pub use dual_ekf::{DualFilter, DualFiltered, DualStart};
pub use initialisation::Initialisation;
pub use prediction_error::{PredictionError, PredictionErrorFit};

use crate::filter::FilterError;
use crate::math::DifferenceError;
use crate::optimise::{BoundsError, OptimiseError};
use crate::twin::{ParameterError, RecordError, SimulationError};

/// Why a baseline gave no estimate.
#[derive(Debug, thiserror::Error)]
pub enum BaselineError {
    /// The record does not fit the twin.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The start does not fit the twin, or lies outside the bounds.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The twin failed.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The search failed.
    #[error(transparent)]
    Optimise(#[from] OptimiseError),
    /// Bounds without an inside.
    #[error(transparent)]
    Bounds(#[from] BoundsError),
    /// No derivative could be taken.
    #[error(transparent)]
    Difference(#[from] DifferenceError),
    /// The filter failed.
    #[error(transparent)]
    Filter(#[from] FilterError),
    /// A setting that cannot be used.
    #[error("{name} = {value}; {remedy}")]
    Setting {
        /// Which.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        remedy: &'static str,
    },
}

impl BaselineError {
    /// Fails with `remedy` unless `valid`.
    fn check(
        name: &'static str,
        value: f64,
        valid: bool,
        remedy: &'static str,
    ) -> Result<(), Self> {
        if valid {
            return Ok(());
        }
        Err(Self::Setting {
            name,
            value,
            remedy,
        })
    }
}
