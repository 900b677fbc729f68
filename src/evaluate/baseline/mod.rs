//! Baselines: the prediction-error method, the dual Kalman filter, and their starts.
//!
//! | to … | look at |
//! |---|---|
//! | fit the noise-free output, six steps as in the paper or to convergence | [`PredictionErrorMethod`] |
//! | track θ along the record | [`DualFilter`] |
//! | choose where they start | [`Initialisation`] |

mod dual_ekf;
mod initialisation;
mod prediction_error;

pub use dual_ekf::{DualFilter, DualStart};
pub use initialisation::Initialisation;
pub use prediction_error::PredictionErrorMethod;
