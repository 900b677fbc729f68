//! Errors of a diagnosis.

use crate::effect::EffectError;
use crate::likelihood::kalman::FilterError;
use crate::progress::Cancelled;
use crate::record::RecordError;
use crate::setting::SettingError;
use crate::twin::{ParameterError, SimulationError};
use std::fmt;

/// Why there is no diagnosis.
///
/// ```
/// use truetwin::diagnose::{DiagnoseError, DiagnoseSettings, diagnose};
/// use truetwin::progress::Progress;
/// use truetwin::study::{RecordPlan, Study};
/// use truetwin::twins::VanDerPol;
///
/// let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 200))?;
/// let nothing = diagnose(&study, &[], None, &DiagnoseSettings::default(), &Progress::silent());
/// assert!(matches!(nothing, Err(DiagnoseError::NoRecord)));
/// # Ok::<(), truetwin::study::StudyError>(())
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DiagnoseError {
    /// No record.
    #[error("no record was given; give at least one")]
    NoRecord,
    /// Records of different steps.
    #[error("{record} has a step of {given} s, the first record {expected} s; resample it")]
    Steps {
        /// Which.
        record: GivenRecord,
        /// Its step.
        given: f64,
        /// That of the first.
        expected: f64,
    },
    /// Too short to say anything.
    #[error("{record} has {samples} samples; at least {least} are needed, measure longer")]
    TooShort {
        /// Which.
        record: GivenRecord,
        /// Its samples.
        samples: usize,
        /// What is needed.
        least: usize,
    },
    /// A setting that cannot be used.
    #[error(transparent)]
    Context(#[from] SettingError),
    /// An effect to leave out that there is not.
    #[error(
        "--without names {0}, which is no effect of this twin; `truetwin effects --twin T` lists them"
    )]
    Without(String),
    /// The filter works nowhere.
    #[error(
        "the twin can be fitted to the record from no start; check units and step of the record, and the prior"
    )]
    NoFit,
    /// Channels that are not the twin's.
    #[error("{record} is not of this twin: {error}")]
    Channels {
        /// Which.
        record: GivenRecord,
        /// What is wrong.
        error: RecordError,
    },
    /// Of a part of a record.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// Of a filter.
    #[error(transparent)]
    Filter(#[from] FilterError),
    /// Of an effect.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// Of parameters.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// Of a simulation.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// Stopped.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl DiagnoseError {
    /// The record that is to blame, where one is.
    pub fn record(&self) -> Option<GivenRecord> {
        match self {
            Self::Steps { record, .. }
            | Self::TooShort { record, .. }
            | Self::Channels { record, .. } => Some(*record),
            Self::NoFit => Some(GivenRecord::Measured(0)),
            _ => None,
        }
    }
}

/// One of the records that a diagnosis was given.
///
/// ```
/// use truetwin::diagnose::{DiagnoseError, DiagnoseSettings, GivenRecord, diagnose};
/// use truetwin::progress::Progress;
/// use truetwin::study::{RecordPlan, Study};
/// use truetwin::effect::*;
/// use truetwin::record::*;
/// use truetwin::twin::*;
/// use truetwin::twins::VanDerPol;
///
/// let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 200))?;
/// let drive = Drive::autonomous(0.05, 20)?;
/// let short = Record::new(drive.clone(), VanDerPol.simulate(&[1.5], &drive, Noise::OFF)?)?;
/// let error: DiagnoseError =
///     diagnose(&study, &[short], None, &DiagnoseSettings::default(), &Progress::silent()).unwrap_err();
/// assert_eq!(error.record(), Some(GivenRecord::Measured(0)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum GivenRecord {
    /// Its place among the records, from 0.
    Measured(usize),
    /// The one that is held out.
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
