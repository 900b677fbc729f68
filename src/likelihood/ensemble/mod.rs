//! Likelihood of a twin without equations, from an ensemble of its simulations.
//!
//! | step | file |
//! |---|---|
//! | runs at one θ under the record's own input, the same draws at every θ | `runs.rs` |
//! | prediction of each row from the rows before it: innovations, covariances | `predictor.rs` |
//! | density of innovations with outliers among them | `tail.rs` |
//! | measurement noise for a simulator without noise of its own | `silent.rs` |
//!
//! Source: Wood, "Statistical inference for noisy nonlinear ecological dynamic systems", *Nature* 466 (2010): a synthetic
//! likelihood is Gaussian, with mean and covariance of what is simulated.

mod predictor;
mod row;
mod runs;
mod silent;
mod tail;

pub(crate) use predictor::Predictor;
pub(crate) use silent::measured;

use crate::likelihood::kalman::FilterError;
use crate::record::Record;
use crate::twin::DigitalTwin;
use runs::Ensemble;

/// Predictor of records under the drive of `record`, at θ.
pub(crate) fn predictor(
    twin: &dyn DigitalTwin,
    theta: &[f64],
    record: &Record,
) -> Result<Predictor, FilterError> {
    let ensemble = Ensemble::new(twin, theta, record.drive())?;
    Ok(Predictor::new(&ensemble, record))
}
