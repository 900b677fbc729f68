//! What the estimator is compared with: the prediction-error method, the dual Kalman filter, and their starts.
//!
//! | to … | look at |
//! |---|---|
//! | fit the noise-free output, six steps as in the paper or to convergence | [`PredictionErrorMethod`] |
//! | track θ along the record | [`DualFilter`] |
//! | choose where they start | [`Initialisation`] |

mod dual_ekf;
mod initialisation;
mod prediction_error;

pub use crate::fit::{BoundsError, OptimiseError};
pub use dual_ekf::{DualFilter, DualFiltered, DualStart};
pub use initialisation::Initialisation;
pub use prediction_error::{PredictionErrorFit, PredictionErrorMethod};

use crate::likelihood::kalman::FilterError;
use crate::math::DifferenceError;
use crate::record::RecordError;
use crate::setting::SettingError;
use crate::twin::{SimulationError, TwinError};

/// Why a baseline gave no estimate.
///
/// ```
/// use truetwin::evaluate::baseline::{BaselineError, PredictionErrorMethod};
/// use truetwin::effect::*;
/// use truetwin::record::*;
/// use truetwin::twin::*;
/// use truetwin::twins::VanDerPol;
///
/// let drive = Drive::autonomous(0.05, 300)?;
/// let outputs = VanDerPol.simulate(&[1.5], &drive, Noise::new(1, "doc", 0))?;
/// let record = Record::new(drive, outputs)?;
/// let wrong = PredictionErrorMethod { step: 2.0, ..PredictionErrorMethod::default() };
/// let error = wrong.fit(&VanDerPol, &record, &[1.4]).unwrap_err();
/// assert!(matches!(error, BaselineError::Setting(_)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BaselineError {
    /// The record does not fit the twin.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The start does not fit the twin, or lies outside the bounds.
    #[error(transparent)]
    Parameter(#[from] TwinError),
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
    #[error(transparent)]
    Setting(#[from] SettingError),
}
