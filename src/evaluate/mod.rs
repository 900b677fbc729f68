//! Measures how good estimates and diagnoses are.
//!
//! | to … | look at |
//! |---|---|
//! | compare with the prediction-error method and the dual Kalman filter | [`baseline`] |
//! | reproduce the paper's tables | [`paper`] |
//! | diagnose sealed records whose missing effect is withheld | [`trials`] |

pub mod baseline;
mod error;
pub mod paper;
pub mod trials;

pub use error::EvaluateError;
