//! Stage 1: from a trajectory to a few features.
//!
//! A file holds a [`FeatureRecipe`]; *bound* to a twin it is a [`FeatureMap`].
//!
//! | recipe | features | suits |
//! |---|---|---|
//! | [`Ar`] | AR(p) coefficients of each output | twins without input |
//! | [`Arx`] | ARX(p, q) coefficients of each output, with all inputs | twins with inputs |
//! | [`Armax`] | ARMAX(p, q, r) coefficients and noise level of each output | coloured noise; black boxes |
//! | [`Score`] | Newton step and information of a filter's likelihood | twins with equations |
//! | [`Deviation`] | block means of the output's deviation from a reference run | records that the twin must *track*; starts; misspecified twins |

mod armax;
mod deviation;
mod regression;
mod score;

pub use armax::Armax;
pub use deviation::Deviation;
pub use regression::{Ar, Arx};
pub use score::Score;

use crate::likelihood::kalman::FilterError;
use crate::math::MathError;
use crate::record::{Drive, RecordError, Signal};
use crate::setting::{count, number};
use crate::twin::{SimulationError, Twin};
use std::fmt::Debug;
use std::sync::Arc;

/// A fixed compression h of a trajectory to n numbers.
///
/// Source: Lakshminarayanan, Guerrero & Rojas, section III-A.
///
/// ```
/// use std::sync::Arc;
/// use truetwin::feature::{FeatureMap, FeatureRecipe, Score};
/// use truetwin::record::Drive;
/// use truetwin::twin::{DigitalTwin, Noise, Twin};
/// use truetwin::twins::VanDerPol;
///
/// let twin = Twin::new(VanDerPol);
/// let drive = Drive::autonomous(0.05, 200)?;
/// let outputs = twin.simulate(&[1.5], &drive, Noise::new(1, "doc", 0))?;
/// let map: Arc<dyn FeatureMap> = Score::default().bind(&twin)?;
/// assert_eq!(map.extract(&drive, &outputs)?.len(), map.dim());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait FeatureMap: Send + Sync {
    /// Number of features n.
    fn dim(&self) -> usize;

    /// Features of outputs (N × channels) under `drive`; length [`dim`](Self::dim), all finite.
    fn extract(&self, drive: &Drive, outputs: &Signal) -> Result<Vec<f64>, FeatureError>;

    /// Features of several simulations, each as [`extract`](Self::extract) finds them, to the bit; for maps that are faster so.
    fn extract_all(&self, all: &[(&Drive, &Signal)]) -> Vec<Result<Vec<f64>, FeatureError>> {
        let each = |(drive, outputs): &(&Drive, &Signal)| self.extract(drive, outputs);
        all.iter().map(each).collect()
    }

    /// Number of simulations that [`extract_all`](Self::extract_all) is best given at once.
    fn at_once(&self) -> usize {
        1
    }

    /// The same features about θ, for features that keep most information near a reference; `None` for all others.
    fn about(&self, _theta: &[f64]) -> Option<Arc<dyn FeatureMap>> {
        None
    }
}

/// Feature map as study and estimator files hold it: `{ kind = "ar", order = 5 }`.
///
/// Register an own recipe with `#[typetag::serde(name = "…")]`; the name is its `kind`.
///
/// ```
/// use serde::{Deserialize, Serialize};
/// use std::sync::Arc;
/// use truetwin::feature::{FeatureError, FeatureMap, FeatureRecipe};
/// use truetwin::record::{Drive, Signal};
/// use truetwin::twin::Twin;
/// use truetwin::twins::VanDerPol;
///
/// /// The mean square of the first output.
/// #[derive(Debug, Serialize, Deserialize)]
/// struct Power;
///
/// #[typetag::serde(name = "power")]
/// impl FeatureRecipe for Power {
///     fn bind(&self, _: &Twin) -> Result<Arc<dyn FeatureMap>, FeatureError> {
///         Ok(Arc::new(Self))
///     }
/// }
///
/// impl FeatureMap for Power {
///     fn dim(&self) -> usize {
///         1
///     }
///     fn extract(&self, _: &Drive, outputs: &Signal) -> Result<Vec<f64>, FeatureError> {
///         let column = outputs.column(0);
///         Ok(vec![column.dot(&column) / column.len() as f64])
///     }
/// }
///
/// let twin = Twin::new(VanDerPol);
/// let map = Power.bind(&twin)?;
/// assert_eq!(map.extract(&Drive::autonomous(0.1, 4)?, &Signal::from_elem((4, 1), 3.0))?, [9.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[typetag::serde(tag = "kind")]
pub trait FeatureRecipe: Debug + Send + Sync {
    /// The map for a twin.
    fn bind(&self, twin: &Twin) -> Result<Arc<dyn FeatureMap>, FeatureError>;
}

/// Why there are no features.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FeatureError {
    /// Orders or sizes that make no sense.
    #[error("features {kind}: {problem}")]
    Setting {
        /// Recipe.
        kind: &'static str,
        /// Problem and remedy.
        problem: String,
    },
    /// A record with missing outputs or varying steps.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// Fewer samples than the features need.
    #[error(
        "the record has {}, these features need {}; take a longer record, or features that need fewer",
        count(*samples, "sample"),
        number(*needed as f64)
    )]
    TooShort {
        /// Samples of the record.
        samples: usize,
        /// Samples needed.
        needed: usize,
    },
    /// An output that never changes.
    #[error(
        "{name} is constant ({}); nothing can be estimated from it: check the sensor, or drive the system",
        number(*value)
    )]
    Constant {
        /// Channel, from 1.
        channel: usize,
        /// Its name, or its number where the twin is not known.
        name: String,
        /// Its value.
        value: f64,
    },
    /// The regression failed.
    #[error("the regression of the features failed: {0}")]
    Regression(#[from] MathError),
    /// The filter failed.
    #[error("the filter of the features failed: {0}")]
    Filter(#[from] FilterError),
    /// The information at the reference is no covariance.
    #[error("the filter's information at the reference is not positive definite")]
    Information,
    /// The reference run failed.
    #[error("the reference run of the features failed: {0}")]
    Reference(#[from] SimulationError),
}

impl FeatureError {
    /// Creates an error for the settings of recipe `kind`.
    fn setting(kind: &'static str, problem: impl Into<String>) -> Self {
        let problem = problem.into();
        Self::Setting { kind, problem }
    }
}

/// Refuses a record of fewer samples than are needed.
fn check_long(samples: usize, needed: usize) -> Result<(), FeatureError> {
    match samples < needed {
        true => Err(FeatureError::TooShort { samples, needed }),
        false => Ok(()),
    }
}

/// Refuses an output that never changes.
fn check_varies(outputs: &Signal) -> Result<(), FeatureError> {
    for (column, channel) in outputs.columns().into_iter().zip(1..) {
        let value = column[0];
        if column.iter().all(|v| *v == value) {
            let name = format!("output {channel}");
            return Err(FeatureError::Constant {
                channel,
                name,
                value,
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod testing {
    use crate::twin::Parameter;
    use crate::twin::fixture::OneState;

    /// One state, `inputs` inputs, one output: ẋ = −k·x + Σu.
    pub(super) fn tank(inputs: usize) -> OneState {
        OneState {
            inputs,
            noise: [0.02, 0.05],
            ..OneState::leaking(Parameter::new("k", "1/s", 0.1, 1.0))
        }
    }
}
