//! Kalman filters over any twin with equations: likelihood, innovations, smoothed states.
//!
//! A filter turns a record into the log-likelihood of θ and into innovations, which are white with unit variance when the twin is right. It
//! needs a twin with equations ([`StateSpace`](crate::twin::StateSpace)); of a black box, `diagnose` asks simulations instead.
//!
//! | to … | look at |
//! |---|---|
//! | filter a record at one θ or many | [`Kalman`] |
//! | get the likelihood | [`Kalman::log_likelihood`] |
//! | see innovations and filtered states | [`Kalman::filter`] |
//! | see the states given the whole record | [`Kalman::smooth`] |
//! | have the gradient and the expected information | [`Score`] |
//! | step in log θ where θ is positive | [`Coordinates`] |
//! | choose the approximation | [`FilterSettings`], [`Method`] |
//!
//! ```
//! use truetwin::likelihood::kalman::{FilterSettings, Kalman};
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
//! let settings = FilterSettings::default();
//! let kalman = Kalman::new(CascadedTanks, &record, &settings)?;
//! let right = kalman.filter(&theta)?;
//! let wrong = kalman.filter(&[0.6, 0.5, 0.7, 1.0])?;
//! assert!(right.log_likelihood > wrong.log_likelihood + 10.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Limits
//!
//! The state is described by a mean and a covariance: distributions with two humps are not. Noise levels must not
//! depend on the state. Outliers make the density of a row
//! a mixture, rounding its mean over a cell; what follows from either for the
//! state is again a mean and a covariance.

mod coordinates;
mod error;
mod filter;
mod filtered;
mod gaussian;
mod likelihood;
mod linearised;
mod moments;
mod normal;
mod number;
mod order;
mod pass;
mod run;
mod score;
mod settings;
mod size;
mod smooth;
mod update;

#[cfg(test)]
mod tests;

pub use coordinates::Coordinates;
pub use error::FilterError;
pub(crate) use error::recoverable;
pub use filter::Kalman;
pub use filtered::{Filtered, States};
pub(crate) use gaussian::Gaussian;
pub(crate) use score::Responses;
pub use score::Score;
pub(in crate::likelihood) use settings::STOPPED;
pub use settings::{FilterSettings, Method};
