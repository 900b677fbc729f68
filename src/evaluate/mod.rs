//! Measures how good estimates and diagnoses are.
//!
//! | to … | look at |
//! |---|---|
//! | reproduce the paper's tables, beside the prediction-error method and the dual Kalman filter | [`paper`] |
//! | diagnose sealed records whose missing effect is withheld | [`trials`] |

pub(crate) mod baseline;
mod count;
mod error;
pub(crate) mod fuzzing;
pub mod paper;
pub mod trials;

pub(crate) use count::{Count, LEVEL, MOST_RECORDS};
pub use error::EvaluateError;
