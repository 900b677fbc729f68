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

mod clip;
mod coordinates;
mod error;
mod filtered;
mod gaussian;
mod kalman;
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

pub use coordinates::Coordinates;
pub use error::FilterError;
pub(crate) use error::recoverable;
pub use filtered::{Filtered, States};
pub use kalman::Kalman;
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
///
/// ```
/// use truetwin::likelihood::kalman::{FilterSettings, filter};
/// use truetwin::record::{Drive, Record};
/// use truetwin::twin::{DigitalTwin, Noise};
/// use truetwin::twins::VanDerPol;
///
/// let drive = Drive::autonomous(0.05, 100)?;
/// let outputs = VanDerPol.simulate(&[1.5], &drive, Noise::new(1, "doc", 0))?;
/// let record = Record::new(drive, outputs)?;
///
/// let found = filter(&VanDerPol, &[1.5], &record, &FilterSettings::default())?;
/// let mean_square = found.standardised.mapv(|z| z * z).mean().ok_or("samples")?;
/// assert!((mean_square - 1.0).abs() < 0.5); // innovations of the right twin have variance 1
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
///
/// ```
/// use truetwin::likelihood::kalman::{FilterSettings, log_likelihood};
/// use truetwin::record::{Drive, Record};
/// use truetwin::twin::{DigitalTwin, Noise};
/// use truetwin::twins::VanDerPol;
///
/// let drive = Drive::autonomous(0.05, 100)?;
/// let outputs = VanDerPol.simulate(&[1.5], &drive, Noise::new(1, "doc", 0))?;
/// let record = Record::new(drive, outputs)?;
///
/// let at = |nu: f64| log_likelihood(&VanDerPol, &[nu], &record, &FilterSettings::default());
/// assert!(at(1.5)? > at(1.7)?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
///
/// ```
/// use truetwin::likelihood::kalman::{FilterSettings, Smoothed, smooth};
/// use truetwin::record::{Drive, Record};
/// use truetwin::twin::{DigitalTwin, Noise};
/// use truetwin::twins::VanDerPol;
///
/// let drive = Drive::autonomous(0.05, 100)?;
/// let outputs = VanDerPol.simulate(&[1.5], &drive, Noise::new(1, "doc", 0))?;
/// let record = Record::new(drive, outputs)?;
///
/// let smoothed: Smoothed = smooth(&VanDerPol, &[1.5], &record, &FilterSettings::default())?;
/// let position = smoothed.states.means[[50, 0]];
/// assert!((position - record.outputs()[[50, 0]]).abs() < 1e-3); // measured without error
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn smooth(
    twin: &dyn StateSpace,
    theta: &[f64],
    record: &Record,
    settings: &FilterSettings,
) -> Result<Smoothed, FilterError> {
    Kalman::new(twin, record, settings)?.smooth(theta)
}
