//! Errors of a diagnosis.

use crate::effect::EffectError;
use crate::likelihood::kalman::FilterError;
use crate::progress::Cancelled;
use crate::record::RecordError;
use crate::setting::{SettingError, number};
use crate::twin::{SimulationError, TwinError};
use std::fmt;

/// Reasons for a diagnosis to fail.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DiagnoseError {
    /// No record.
    #[error("no record given; pass at least one")]
    NoRecord,
    /// Records of different steps.
    #[error("{record} has a step of {} s, the first record {} s; resample it", number(*given), number(*expected))]
    Steps {
        /// The record.
        record: GivenRecord,
        /// Step of the record, in seconds.
        given: f64,
        /// Step of the first record.
        expected: f64,
    },
    /// A record that is too short.
    #[error("{record} has {samples} samples; at least {least} are needed, measure longer")]
    TooShort {
        /// The record.
        record: GivenRecord,
        /// Number of samples.
        samples: usize,
        /// Least number of samples.
        least: usize,
    },
    /// An invalid setting.
    #[error(transparent)]
    Context(#[from] SettingError),
    /// An unknown effect in `without`.
    #[error("unknown effect {0} in --without; `truetwin effects --twin T` lists those of a twin")]
    Without(String),
    /// No starting point can be fitted.
    #[error(
        "no starting point could be fitted to the record; check units and step of the record, and the prior"
    )]
    NoFit,
    /// Every simulation of the fitted twin fails.
    #[error(
        "no simulation of the fitted twin could be evaluated; check units and step of the record, and the prior"
    )]
    NoSimulation,
    /// A record with channels or steps that the twin cannot have.
    #[error("{record} does not fit the twin: {error}")]
    Channels {
        /// The record.
        record: GivenRecord,
        /// The error.
        error: RecordError,
    },
    /// An error in a part of a record.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// An error of the filter.
    #[error(transparent)]
    Filter(#[from] FilterError),
    /// An error of an effect.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// An error of parameters.
    #[error(transparent)]
    Parameter(#[from] TwinError),
    /// An error of a simulation.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// Cancelled by the caller.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl DiagnoseError {
    /// Returns the record that caused the error, if one did.
    pub fn record(&self) -> Option<GivenRecord> {
        match self {
            Self::Steps { record, .. }
            | Self::TooShort { record, .. }
            | Self::Channels { record, .. } => Some(*record),
            Self::NoFit | Self::NoSimulation => Some(GivenRecord::Measured(0)),
            _ => None,
        }
    }
}

/// A record given to a diagnosis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum GivenRecord {
    /// Index among the measured records, from 0.
    Measured(usize),
    /// The validation record.
    Validation,
}

impl fmt::Display for GivenRecord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Measured(index) => write!(f, "record {}", index + 1),
            Self::Validation => f.write_str("the validation record"),
        }
    }
}
