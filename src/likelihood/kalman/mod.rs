//! Kalman filters over any twin with equations: likelihood, innovations, smoothed states.
//!
//! A filter turns a record into the log-likelihood of θ and into innovations, which are white with unit variance
//! when the twin is right. It needs a [`StateSpace`] twin; of a black box, `diagnose` asks simulations instead.
//!
//! | to … | look at |
//! |---|---|
//! | get the likelihood of one θ | [`log_likelihood`] |
//! | see innovations and filtered states | [`filter`] |
//! | see what the states were, given the whole record | [`smooth`] |
//! | evaluate many θ on the same record | [`Kalman`] |
//! | have the gradient, and the outer product of gradients | [`Score`] |
//! | step in log θ where θ is positive | [`Coordinates`] |
//! | choose the approximation | [`FilterSettings`], [`Method`] |
//!
//! ```
//! use truetwin::likelihood::kalman::{FilterSettings, filter};
//! use truetwin::effect::*;
//! use truetwin::record::*;
//! use truetwin::twin::*;
//! use truetwin::twins::CascadedTanks;
//!
//! let theta = [0.6, 0.5, 0.55, 1.0];
//! let drive = Drive::new(0.5, Signal::from_elem((400, 1), 1.5))?;
//! let outputs = CascadedTanks.simulate(&theta, &drive, Noise::new(1, "doc", 0))?;
//! let record = Record::new(drive, outputs)?;
//!
//! let right = filter(&CascadedTanks, &theta, &record, &FilterSettings::default())?;
//! let wrong = filter(&CascadedTanks, &[0.6, 0.5, 0.7, 1.0], &record, &FilterSettings::default())?;
//! assert!(right.log_likelihood > wrong.log_likelihood + 10.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Limits
//!
//! The state is described by a mean and a covariance: distributions with two humps are not. Noise levels must not
//! depend on the state. Outliers ([`StateSpace::outliers`]) make the density of a row a mixture; what follows from it for the
//! state is again a mean and a covariance.

mod bound;
mod clip;
mod coordinates;
mod error;
mod filtered;
mod gaussian;
mod likelihood;
mod linearised;
mod moments;
mod pass;
mod score;
mod settings;
mod size;
mod smooth;
mod tail;
mod update;

#[cfg(test)]
mod linear;

pub use bound::Kalman;
pub use coordinates::Coordinates;
pub use error::FilterError;
pub(crate) use error::recoverable;
pub use filtered::{Filtered, States};
pub use score::Score;
pub use settings::{FilterSettings, Method};
pub use smooth::Smoothed;

use crate::record::Record;
use crate::twin::StateSpace;

/// Log-likelihood, innovations and, if the settings ask for them, filtered states of one record at θ.
///
/// # Errors
///
/// As [`Kalman::new`] and [`Kalman::filter`].
pub fn filter(
    twin: &dyn StateSpace,
    theta: &[f64],
    record: &Record,
    settings: &FilterSettings,
) -> Result<Filtered, FilterError> {
    Kalman::new(twin, record, settings)?.filter(theta)
}

/// Log-likelihood of one record at θ, in nats; nothing else is stored.
///
/// # Errors
///
/// As [`Kalman::new`] and [`Kalman::log_likelihood`].
pub fn log_likelihood(
    twin: &dyn StateSpace,
    theta: &[f64],
    record: &Record,
    settings: &FilterSettings,
) -> Result<f64, FilterError> {
    Kalman::new(twin, record, settings)?.log_likelihood(theta)
}

/// States at each sample given the whole record, at θ.
///
/// # Errors
///
/// As [`Kalman::new`] and [`Kalman::smooth`].
pub fn smooth(
    twin: &dyn StateSpace,
    theta: &[f64],
    record: &Record,
    settings: &FilterSettings,
) -> Result<Smoothed, FilterError> {
    Kalman::new(twin, record, settings)?.smooth(theta)
}
