//! Baselines: the prediction-error method, the dual Kalman filter, and their starts.

mod dual_ekf;
mod initialisation;
mod numbers;
mod prediction_error;

pub use dual_ekf::dual_filter;
pub use initialisation::Initialisation;
pub use prediction_error::prediction_error;
