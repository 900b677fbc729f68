//! Likelihood of a twin without equations, from an ensemble of its simulations.
//!
//! | step | file |
//! |---|---|
//! | runs at one θ under the record's own input, the same draws at every θ | `runs.rs` |
//! | prediction of each row from the rows before it: innovations, covariances | `predictor.rs` |
//! | density of innovations with outliers among them | `tail.rs` |
//! | where all noise is that of the sensors, of known kind: a filter, and one run in place of an ensemble | `known.rs` |
//! | measurement noise for a simulator without noise of its own | `silent.rs` |
//!
//! Source: Wood, "Statistical inference for noisy nonlinear ecological dynamic systems", *Nature* 466 (2010): a synthetic
//! likelihood is Gaussian, with mean and covariance of what is simulated.

mod known;
mod predictor;
mod row;
mod runs;
mod silent;
mod tail;

pub(crate) use predictor::Predictor;
pub(crate) use silent::measured;

use crate::likelihood::kalman::{FilterError, Filtered};
use crate::record::Record;
use crate::twin::{ComposedBlackBox, DigitalTwin, SimulationError};
use runs::Ensemble;

/// Innovations of a record at θ: of a filter where the noise is known, else as an ensemble predicts them.
pub(crate) fn filtered(
    twin: &ComposedBlackBox,
    theta: &[f64],
    record: &Record,
) -> Result<Filtered, FilterError> {
    let drive = record.drive();
    drive.check_uniform().map_err(SimulationError::of)?;
    match twin.known_noise(theta, drive)? {
        Some(known) => known::filtered(&known, record),
        None => Ok(predictor(twin, theta, record)?.filter(record.outputs())),
    }
}

/// Predictor of records under the drive of `record`, at θ.
pub(crate) fn predictor(
    twin: &dyn DigitalTwin,
    theta: &[f64],
    record: &Record,
) -> Result<Predictor, FilterError> {
    let ensemble = Ensemble::new(twin, theta, record.drive())?;
    Ok(Predictor::new(&ensemble, record))
}
