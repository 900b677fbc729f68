//! The likelihood of a twin that shows no equations, from its simulations alone.
//!
//! A diagnosis asks a twin for one thing: innovations of a record and their covariances at some θ. With equations a filter
//! gives them; here an ensemble of simulations does. All else, from the scan to the share that closes, is the same.
//!
//! | step | file |
//! |---|---|
//! | runs at one θ under the record's own input, the same draws at every θ | `ensemble.rs` |
//! | each row predicted from the rows before it, as the runs do: innovations, covariances | `predictor.rs` |
//! | the density of innovations with outliers among them | `tail.rs` |
//! | gradient and information of that likelihood | `slope.rs` |
//! | a first fit that keeps in phase | `growing.rs` |
//! | simulated records looked at without simulating each of them anew | `shared.rs` |
//! | a simulator without noise of its own | `silent.rs` |
//! | the disturbance that stands for whatever is not listed | `disturbed.rs` |
//!
//! Source: Wood, "Statistical inference for noisy nonlinear ecological dynamic systems", *Nature* 466 (2010): a synthetic
//! likelihood is Gaussian, with mean and covariance of what is simulated.

mod disturbed;
mod ensemble;
mod growing;
mod predictor;
mod shared;
mod silent;
mod slope;
mod tail;

pub(super) use disturbed::disturbed;
pub(super) use growing::base_fit;
pub(super) use predictor::Predictor;
pub(super) use shared::Shared;
pub(super) use silent::{dithered, measured};
pub(super) use slope::slope;

use crate::likelihood::kalman::{FilterError, Filtered};
use crate::record::Record;
use crate::twin::{DigitalTwin, Outline};
use ensemble::Ensemble;

/// A record as the ensemble at θ sees it.
pub(super) fn filtered(
    twin: &dyn DigitalTwin,
    theta: &[f64],
    record: &Record,
) -> Result<Filtered, FilterError> {
    Ok(predictor(twin, theta, record)?.filter(record.outputs()))
}

/// What predicts records under the drive of `record`, at θ.
pub(super) fn predictor(
    twin: &dyn DigitalTwin,
    theta: &[f64],
    record: &Record,
) -> Result<Predictor, FilterError> {
    let ensemble = Ensemble::new(twin, theta, record.drive())?;
    Ok(Predictor::new(&ensemble, record.outputs()))
}

/// What stands for an outline: the predicted outputs are the only states that there are.
pub(super) fn outline(twin: &dyn DigitalTwin) -> Outline {
    let signals = twin.signals();
    Outline {
        parameters: twin.parameters(),
        states: signals.outputs.clone(),
        inputs: signals.inputs,
        outputs: signals.outputs,
    }
}
