//! Baselines: the prediction-error method, the dual Kalman filter, and their starts.
//!
//! | to … | look at |
//! |---|---|
//! | fit the noise-free output, six steps as in the paper | [`PredictionErrorMethod`] |
//! | track θ along the record | [`DualFilter`] |
//! | choose where they start | [`Initialisation`] |

mod dual_ekf;
mod initialisation;
mod prediction_error;
#[cfg(test)]
mod tests;

pub use dual_ekf::DualFilter;
pub use initialisation::Initialisation;
pub use prediction_error::PredictionErrorMethod;
