//! Which filter, and its few numbers.

use super::FilterError;
use crate::record::Record;
use crate::setting::SettingError;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Method that carries means and covariances through the equations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Method {
    /// Linearised at the mean, Jacobians by central differences; limits act on the moments. Exact for linear twins without limits.
    Extended,
    /// Points at ±√3 standard deviations along each direction of state and process noise go through the real step
    /// (divided differences of second order); limits act on the moments. Exact for linear twins without limits.
    #[default]
    Points,
}

/// Settings of a filter.
///
/// | setting | default | range | meaning |
/// |---|---|---|---|
/// | `method` | points | | how moments are carried through the equations |
/// | `noise_floor` | 1e-13 | [0, 1) | least variance of the measurement noise, as a share of the output's variance over the record |
/// | `start_covariance` | none | symmetric, ≥ 0 | covariance of the first state, in products of state units; none: the start is known |
/// | `keep_states` | no | | keep filtered means and covariances in [`Filtered`](super::Filtered) |
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(
    deny_unknown_fields,
    default,
    expecting = "a table of settings of the filter"
)]
pub struct FilterSettings {
    /// Method that carries moments through the equations.
    pub method: Method,
    /// Least variance of the measurement noise, as a share of the output's variance.
    pub noise_floor: f64,
    /// Covariance of the first state.
    pub start_covariance: Option<DMatrix<f64>>,
    /// `true` if filtered states are kept.
    pub keep_states: bool,
}

/// Readings that stop at an end of their range are compared with others as if they had a jitter of this share of the output's motion: none
/// is infinitely likely. A tenth of it gives each such reading 2.3 nats more, whatever makes it stop.
pub(in crate::likelihood) const STOPPED: f64 = 1e-3;

impl Default for FilterSettings {
    fn default() -> Self {
        Self {
            method: Method::default(),
            noise_floor: 1e-13,
            start_covariance: None,
            keep_states: false,
        }
    }
}

impl FilterSettings {
    /// Least variance of the measurement noise of each output of a record.
    pub(in crate::likelihood) fn floors(&self, record: &Record) -> Vec<f64> {
        (record.outputs().columns().into_iter())
            .map(|y| self.noise_floor * scale(y.iter().copied().filter(|v| !v.is_nan())))
            .collect()
    }

    /// Jitter of readings of each output at an end of its sensor's range, as standard deviations.
    pub(super) fn jitters(record: &Record) -> Vec<f64> {
        (record.outputs().columns().into_iter())
            .map(|y| STOPPED * scale(y.iter().copied().filter(|v| !v.is_nan())).sqrt())
            .collect()
    }

    /// With another method.
    #[must_use]
    pub fn with_method(mut self, method: Method) -> Self {
        self.method = method;
        self
    }

    /// Checks whether they can be used with a twin of `states` states.
    pub(super) fn check(&self, states: usize) -> Result<(), FilterError> {
        let floor = self.noise_floor;
        SettingError::unless(
            (0.0..1.0).contains(&floor),
            "noise_floor",
            floor,
            "it must lie in [0, 1), such as 1e-13",
        )?;
        let Some(covariance) = &self.start_covariance else {
            return Ok(());
        };
        let (rows, columns) = covariance.shape();
        let square = (rows, columns) == (states, states);
        let scale = covariance.amax();
        let valid = square
            && covariance.iter().all(|v| v.is_finite())
            && (covariance - covariance.transpose()).amax() <= 1e-12 * scale
            && covariance.symmetric_eigenvalues().min() >= -1e-12 * scale;
        if !valid {
            return Err(FilterError::StartCovariance {
                rows,
                columns,
                states,
            });
        }
        Ok(())
    }
}

/// Variance of an output; of a constant one, its mean square; of zeros, one.
fn scale(y: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = y.clone().count() as f64;
    let mean = y.clone().sum::<f64>() / n;
    let variance = y.map(|v| (v - mean).powi(2)).sum::<f64>() / n;
    [variance, mean * mean, 1.0]
        .into_iter()
        .find(|v| *v > 0.0)
        .unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    #[test]
    fn what_cannot_be_used_is_named() {
        let negative = FilterSettings {
            noise_floor: -1.0,
            ..FilterSettings::default()
        };
        let error = negative.check(1).unwrap_err().to_string();
        assert!(error.starts_with("noise_floor = -1;"), "{error}");
        for bad in [
            dmatrix![1.0, 0.5; 0.4, 1.0],
            dmatrix![1.0, 2.0; 2.0, 1.0],
            dmatrix![1.0],
        ] {
            let settings = FilterSettings {
                start_covariance: Some(bad),
                ..FilterSettings::default()
            };
            let error = settings.check(2).unwrap_err().to_string();
            assert!(error.contains("2 × 2"), "{error}");
        }
    }

    #[test]
    fn files_say_only_what_differs() {
        let settings: FilterSettings = toml::from_str("method = \"extended\"").unwrap();
        assert_eq!(
            settings,
            FilterSettings::default().with_method(Method::Extended)
        );
        assert!(toml::from_str::<FilterSettings>("kind = 1").is_err());
    }
}
