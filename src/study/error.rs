//! The error of a study, its fits and its diagnoses.

use crate::equations::EquationsError;
use crate::likelihood::kalman::FilterError;
use crate::progress::Cancelled;
use crate::record::RecordError;
use crate::setting::{SettingError, count, did_you_mean, number};
use crate::storage::files::with_remedy;
use crate::twin::{SimulationError, TwinError};
use std::borrow::Cow;
use std::path::PathBuf;

/// Error of a study, its file, its records, or a fit or diagnosis of them.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StudyError {
    /// The study file cannot be read.
    #[error("{}: {}", path.display(), with_remedy(error))]
    Io {
        /// File.
        path: PathBuf,
        /// The system's error.
        error: std::io::Error,
    },
    /// The text of the study file is wrong.
    #[error("{}, line {line}: {message}; correct that line", path.display())]
    Syntax {
        /// File.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Message of the parser, in one line.
        message: String,
    },
    /// The equations of a study file are wrong.
    #[error(transparent)]
    Equations(#[from] EquationsError),
    /// A study is to be made of a file that has no equations of its own.
    #[error(
        "the study file has no equations, it is about the twin \"{0}\"; add the tables states and outputs, or configure a study of that twin"
    )]
    NoEquations(String),
    /// A program or an FMU cannot be used as a twin.
    #[error("{0}")]
    Simulator(String),
    /// The study is about an unknown twin.
    #[error("no twin is called \"{given}\"{}; there are {known}", did_you_mean(given, known.split(", ")))]
    Twin {
        /// Name in the file.
        given: String,
        /// Known twins.
        known: String,
    },
    /// Prior, bounds, limits, noise, starts or an effect do not fit the twin.
    #[error(transparent)]
    Adaptation(#[from] TwinError),
    /// A value of the study file cannot be, or does not fit the twin.
    #[error("{}, line {line}: {error}", path.display())]
    At {
        /// File.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// The problem there, and the remedy.
        error: Box<Self>,
    },
    /// The study file names no twin.
    #[error("{}: the key twin is missing; add twin = \"NAME\"", .0.display())]
    NoTwin(PathBuf),
    /// The twin's own parameters, or values of the study, are wrong.
    #[error("{0}")]
    Table(String),
    /// A fixed value that its parameter cannot have, or of a name that none has.
    #[error("fixed: {error}")]
    Fixed {
        /// Name in the file.
        name: String,
        /// Problem and remedy.
        error: TwinError,
    },
    /// A parameter in two tables of a study.
    #[error("{name} appears in both fixed and {table}; remove one")]
    Twice {
        /// Parameter.
        name: String,
        /// The other table.
        table: &'static str,
    },
    /// No parameter is left to estimate.
    #[error("all parameters are fixed, nothing is left to estimate; free one")]
    AllFixed,
    /// The library of a study names an unknown effect.
    #[error("library: {name}{near} is no effect of this twin; correct or remove it")]
    UnknownEffect {
        /// Name in the file.
        name: String,
        /// Name that may be meant, in brackets.
        near: String,
    },
    /// The library of a study leaves no effect.
    #[error("library: without names all of only, so that nothing is left; remove one of the two")]
    NoEffects,
    /// Step, length or input of simulated records are wrong.
    #[error("{0}")]
    Plan(String),
    /// A twin with inputs whose simulated records have none.
    #[error("the twin has {}; give simulated records levels or a file as input", count(*.0, "input"))]
    NoInput(usize),
    /// A record with another step than the study's.
    #[error(
        "the record's step is {} s, the study's {} s; resample the record, or change the step of the study",
        number(*given),
        number(*expected)
    )]
    OtherStep {
        /// Step of the record, in seconds.
        given: f64,
        /// Step of the study.
        expected: f64,
    },
    /// The likelihood of a record cannot be computed.
    #[error(transparent)]
    Filter(FilterError),
    /// The work was stopped.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// No parameters fit a record.
    #[error(
        "the twin cannot be filtered at any parameters that were tried{cause}; check units, step and bounds"
    )]
    NoFit {
        /// Fault at the centre of the prior, in brackets; empty where a run without noise works.
        cause: String,
    },
    /// A record, its file, or its channels are wrong.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// A fit or a diagnosis of no record.
    #[error("no record given; pass at least one")]
    NoRecord,
    /// Simulated records of a study that does not say what they look like.
    #[error(
        "the study has no plan of simulated records; give it step and samples, and input if the twin has one"
    )]
    NoPlan,
    /// Records of a diagnosis have different steps.
    #[error("{} has a step of {} s, the first record {} s; resample it", name(*record), number(*given), number(*expected))]
    Steps {
        /// Index among the measured records, from 0; none for the validation record.
        record: Option<usize>,
        /// Step of the record, in seconds.
        given: f64,
        /// Step of the first record.
        expected: f64,
    },
    /// A record is too short for a diagnosis.
    #[error("{} has {}; at least {least} are needed, measure longer", name(*record), count(*samples, "sample"))]
    TooShort {
        /// Index among the measured records, from 0; none for the validation record.
        record: Option<usize>,
        /// Number of samples.
        samples: usize,
        /// Least number of samples.
        least: usize,
    },
    /// A diagnosis with records whose outputs all keep one value.
    #[error(
        "no output of the {0} ever changes, which tells nothing of the twin; take one in which an output moves"
    )]
    Still(&'static str),
    /// One of several records has channels or steps that the twin cannot have.
    #[error("{} does not fit the twin: {error}", name(*record))]
    Channels {
        /// Index among the measured records, from 0; none for the validation record.
        record: Option<usize>,
        /// The error.
        error: RecordError,
    },
    /// A setting of a fit or a diagnosis is out of range.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// A diagnosis is to leave out an effect that is unknown.
    #[error("unknown effect {0}; leave out effects of this twin")]
    Without(String),
    /// A simulation failed in a way that other parameters cannot mend.
    #[error(transparent)]
    Simulation(SimulationError),
}

/// A record of several, as a message calls it.
fn name(record: Option<usize>) -> String {
    record.map_or("the validation record".into(), |index| {
        format!("record {}", index + 1)
    })
}

impl From<SimulationError> for StudyError {
    fn from(error: SimulationError) -> Self {
        match error.is_stopped() {
            true => Self::Cancelled(Cancelled),
            false => Self::Simulation(error),
        }
    }
}

impl From<FilterError> for StudyError {
    fn from(error: FilterError) -> Self {
        match error.is_cancelled() {
            true => Self::Cancelled(Cancelled),
            false => Self::Filter(error),
        }
    }
}

impl StudyError {
    /// No parameters fit a record, for a reason that [`Study::fit`](super::Study::fit) would tell.
    pub(crate) const NO_FIT: Self = Self::NoFit {
        cause: String::new(),
    };

    /// Returns the table and the key of a study file that it is about, if it is about one.
    pub(super) fn key(&self) -> Option<(&'static str, Cow<'_, str>)> {
        let (table, name): (&'static str, &str) = match self {
            Self::Adaptation(TwinError::UnknownIn { table, name, .. })
            | Self::Adaptation(TwinError::Value { table, name, .. })
            | Self::Twice { table, name } => (*table, name),
            Self::Adaptation(TwinError::Parameter { name, .. }) => ("prior", name),
            Self::Adaptation(TwinError::NoPrior(unknown)) => match unknown.split_once('.')? {
                ("noise", name) => ("noise", name),
                ("start", name) => ("start", name),
                _ => return None,
            },
            Self::Adaptation(TwinError::Begins { name, .. }) => ("start", name),
            Self::Fixed { name, .. } => ("fixed", name),
            Self::UnknownEffect { name, .. } => ("library", name),
            Self::NoEffects => ("library", "only"),
            Self::Twin { .. } => ("twin", ""),
            Self::Record(RecordError::Step(_)) => ("record", "step"),
            // These begin with the key, and those of a plan for each input have its name.
            Self::Plan(problem) => match problem.split([' ', ':']).next()? {
                "input" => {
                    let own = problem.strip_prefix("input ");
                    let own = own.and_then(|rest| rest.split(':').next());
                    let name = own
                        .or_else(|| problem.split('"').nth(1))
                        .unwrap_or_default();
                    return Some(("record", format!("input.{name}").into()));
                }
                key => ("record", key),
            },
            _ => return None,
        };
        Some((table, name.into()))
    }

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
            _ => None,
        }
    }
}
