//! Errors of a diagnosis.

use crate::likelihood::kalman::FilterError;
use crate::progress::Cancelled;
use crate::record::RecordError;
use crate::setting::{SettingError, number};
use crate::twin::{SimulationError, TwinError};

/// Reasons for a diagnosis to fail.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DiagnoseError {
    /// No record.
    #[error("no record given; pass at least one")]
    NoRecord,
    /// Records of different steps.
    #[error("{} has a step of {} s, the first record {} s; resample it", of(*record), number(*given), number(*expected))]
    Steps {
        /// Index among the measured records, from 0; none for the validation record.
        record: Option<usize>,
        /// Step of the record, in seconds.
        given: f64,
        /// Step of the first record.
        expected: f64,
    },
    /// A record that is too short.
    #[error("{} has {samples} samples; at least {least} are needed, measure longer", of(*record))]
    TooShort {
        /// Index among the measured records, from 0; none for the validation record.
        record: Option<usize>,
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
    #[error("{} does not fit the twin: {error}", of(*record))]
    Channels {
        /// Index among the measured records, from 0; none for the validation record.
        record: Option<usize>,
        /// The error.
        error: RecordError,
    },
    /// An error in a part of a record.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// An error of the filter.
    #[error(transparent)]
    Filter(#[from] FilterError),
    /// An error of parameters or of an effect.
    #[error(transparent)]
    Parameter(#[from] TwinError),
    /// An error of a simulation.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// Cancelled by the caller.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// A record, as a message calls it.
fn of(record: Option<usize>) -> String {
    record.map_or("the validation record".into(), |index| {
        format!("record {}", index + 1)
    })
}

impl DiagnoseError {
    /// Returns what stands for the record that caused the error among what stands for all of them, if one did.
    pub(crate) fn culprit<'a, R>(
        &self,
        records: &'a [R],
        validation: Option<&'a R>,
    ) -> Option<&'a R> {
        match self {
            Self::Steps { record, .. }
            | Self::TooShort { record, .. }
            | Self::Channels { record, .. } => match record {
                Some(index) => records.get(*index),
                None => validation,
            },
            Self::NoFit | Self::NoSimulation => records.first(),
            _ => None,
        }
    }
}
