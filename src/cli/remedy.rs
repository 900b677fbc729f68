//! Remedies in the words of the command line: options, verbs, tables of the study file.
//!
//! Errors of the library say what is wrong, where, and what to do in general; these lines say how the command line does it.

use crate::estimator::EstimatorError;
use crate::evaluate::EvaluateError;
use crate::external::program::LATE;
use crate::feature::FeatureError;
use crate::math::MathError;
use crate::network::NetworkError;
use crate::record::RecordError;
use crate::setting::number;
use crate::storage::StorageError;
use crate::study::StudyError;
use crate::twin::conformance::{Finding, Severity};
use crate::twin::{SimulationError, TwinError};
use std::fmt::Display;

/// Where an error comes from.
#[derive(Debug, Clone, Copy)]
pub(super) enum Cause {
    /// The call or one of its files.
    Call,
    /// As [`Call`](Self::Call), most likely the study file.
    Study,
    /// The program itself.
    Internal,
    /// The user, who has stopped the call.
    Stop,
}

/// An error as the command line reports it.
pub(super) trait Remedy {
    /// Returns options, verbs or tables that help.
    fn remedy(&self) -> Option<String> {
        None
    }

    fn cause(&self) -> Cause {
        Cause::Call
    }
}

/// The option for a program that is late, whatever carries its message.
fn more_time(message: &impl Display) -> Option<String> {
    (message.to_string().contains(LATE)).then(|| "--timeout SECONDS allows more".into())
}

impl Remedy for SimulationError {
    fn remedy(&self) -> Option<String> {
        if !matches!(self, Self::Diverged { .. }) {
            return more_time(self);
        }
        Some(
            "a state, an output or a level of noise is no finite number there: other values of --theta or of an effect; for rates, [record] substeps or integrator of the study file".into(),
        )
    }

    fn cause(&self) -> Cause {
        Cause::Study
    }
}

/// Remedies of findings about a record.
impl Remedy for Finding {
    fn remedy(&self) -> Option<String> {
        let remedy = match (self.check, self.severity) {
            ("gaps", _) => "`truetwin resample R.csv --step S --out R2.csv` closes short ones",
            (_, Severity::Pass) => return None,
            ("step", _) => {
                "`truetwin resample R.csv --step S --out R2.csv`; [record] step of the study file; --step-of-record takes the record's, in `estimate` if the features are scores"
            }
            ("swapped", _) => "--columns NAME=COLUMN,..",
            ("inputs", _) => "[record] input of the study file",
            ("scale", _) if self.message.contains("prior") => "[prior] of the study file",
            ("parameters", _) if self.message.contains("fix them") => "[fixed] of the study file",
            _ => return more_time(&self.message),
        };
        Some(remedy.into())
    }
}

impl Remedy for FeatureError {
    fn cause(&self) -> Cause {
        Cause::Study
    }
}

impl Remedy for NetworkError {
    fn cause(&self) -> Cause {
        match self {
            Self::Backend(_) | Self::Cancelled(_) => Cause::Internal,
            _ => Cause::Call,
        }
    }
}

impl Remedy for RecordError {
    fn remedy(&self) -> Option<String> {
        Some(match self {
            Self::Within { error, .. } => return error.remedy(),
            Self::Incomplete { .. } => {
                "`truetwin resample R.csv --step S --out R2.csv` closes short gaps, with --longest-gap longer ones; `truetwin fit` and `truetwin diagnose` take such records".into()
            }
            Self::Uneven { expected, .. } => format!(
                "`truetwin resample R.csv --step {} --out R2.csv`; `truetwin fit` and `truetwin diagnose` take such records",
                number(*expected)
            ),
            Self::Start(_) => "`at` of [start] in the study file, or of a state's start".into(),
            Self::OneStep { .. } => "`truetwin resample R.csv --step S --out R2.csv`".into(),
            Self::Channels { .. } => "`truetwin twins` lists the twins".into(),
            Self::Columns { .. } => {
                "--columns t=NAME,u=NAME,y=NAME takes other names".into()
            }
            _ => return None,
        })
    }
}

impl Remedy for StorageError {
    fn remedy(&self) -> Option<String> {
        Some(match self {
            Self::Taken { .. }
            | Self::OtherCall { .. }
            | Self::OtherVersion { .. }
            | Self::Busy(_) => "choose another --out".into(),
            Self::Foreign { verb, .. } => format!("`truetwin {verb}` makes them"),
            Self::Threads { threads, .. } if *threads > 1 => "--threads N takes fewer".into(),
            Self::NoMpi(_) => {
                "`cargo install --features mpi`, or --shard i/n in a job array".into()
            }
            _ => return None,
        })
    }
}

impl Remedy for TwinError {
    fn remedy(&self) -> Option<String> {
        Some(match self {
            Self::UnknownIn { table, .. } | Self::Value { table, .. } => {
                format!("[{table}] of the study file")
            }
            Self::BlackBox(table) => format!(
                "[{table}] of the study file; a program shows equations in its description or serves drift (docs/external-programs.md)"
            ),
            Self::NoPrior(name) => format!("[prior] \"{name}\" = [low, high] in the study file"),
            Self::EffectText { .. } => "each effect is a table [[effect]]".into(),
            _ => return None,
        })
    }
}

impl Remedy for StudyError {
    fn remedy(&self) -> Option<String> {
        Some(match self {
            Self::Record(error) | Self::Channels { error, .. } => return error.remedy(),
            Self::Adaptation(error) => return error.remedy(),
            Self::At { error, .. } => return error.remedy(),
            Self::NoTwin(_) | Self::Twin { .. } => "`truetwin twins` lists them".into(),
            Self::Twice { table, .. } => format!("[fixed] and [{table}] of the study file"),
            Self::AllFixed => "`truetwin fit` tests the twin on a record".into(),
            Self::UnknownEffect { .. } | Self::Without(_) => {
                "`truetwin effects` lists them, with the --twin, --study, --program or --fmu of this call".into()
            }
            Self::NoInput(_) => {
                "[record] input = { levels = [low, high], hold = n }, a file, or a plan for each input, in the study file"
                    .into()
            }
            Self::NoPlan => "all of them in [record] of the study file".into(),
            Self::Steps { expected, .. } => format!(
                "`truetwin resample R.csv --step {} --out R2.csv`",
                number(*expected)
            ),
            Self::OtherStep { given, expected } => format!(
                "--step-of-record takes it, for `estimate` if the features are scores; `truetwin resample R.csv --step {} --out R2.csv`; [record] step = {} in the study file, and pretrain again where an estimator is used",
                number(*expected),
                number(*given)
            ),
            Self::NoFit { .. } => "[bounds] of the study file".into(),
            _ => return more_time(self),
        })
    }

    fn cause(&self) -> Cause {
        match self {
            Self::Cancelled(_) => Cause::Internal,
            _ => Cause::Study,
        }
    }
}

impl Remedy for EstimatorError {
    fn remedy(&self) -> Option<String> {
        Some(match self {
            Self::Record { error, .. } => return error.remedy(),
            Self::Study(error) => return error.remedy(),
            Self::Work(error) => return error.remedy(),
            Self::NoBank { .. } => "`truetwin bank` makes one, and mends it if called again".into(),
            Self::TooLarge { .. } => "`truetwin bank` makes one".into(),
            Self::NoEstimator { .. } => {
                "`truetwin pretrain` makes one; --program or --fmu names the twin that it was made for"
                    .into()
            }
            Self::Whitening(_) => "[noise] of the study file".into(),
            Self::Search(MathError::Start(_)) => {
                "`truetwin fit` needs no training; if the record begins elsewhere than the twin, [start] of the study file, and pretrain again".into()
            }
            _ => return more_time(self),
        })
    }

    fn cause(&self) -> Cause {
        match self {
            Self::Study(error) => error.cause(),
            Self::Feature(error) => error.cause(),
            Self::Network(error) => error.cause(),
            // A search that a record leaves no start for is no fault of the program.
            Self::Cancelled(_) | Self::Search(MathError::Fatal(_)) => Cause::Internal,
            Self::Simulation(_) | Self::Rejected(_) | Self::Hopeless { .. } | Self::Inputs(_) => {
                Cause::Study
            }
            _ => Cause::Call,
        }
    }
}

impl Remedy for EvaluateError {
    fn remedy(&self) -> Option<String> {
        Some(match self {
            Self::NoPoint(_) | Self::Outside { .. } => {
                "--scenario 0 draws from the prior, --scenario uniform from the bounds".into()
            }
            Self::NoDeparture { .. } | Self::NoTruth { .. } => {
                "--kinds; [prior], [bounds] and [library] of the study file".into()
            }
            Self::Work(error) => return error.remedy(),
            Self::Plan(error) => return error.remedy(),
            Self::Record(error) => return error.remedy(),
            Self::Parameter(error) => return error.remedy(),
            _ => return more_time(self),
        })
    }

    fn cause(&self) -> Cause {
        match self {
            Self::Cancelled(_) => Cause::Internal,
            Self::NoDeparture { .. } | Self::NoTruth { .. } | Self::Plan(_) => Cause::Study,
            _ => Cause::Call,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_late_program_is_given_the_option_for_more_time() {
        let late = || SimulationError::fatal(format!("`x` {LATE} 2 s; flush each answer"));
        let expected = Some("--timeout SECONDS allows more".to_owned());
        assert_eq!(late().remedy(), expected);
        assert_eq!(EstimatorError::Simulation(late()).remedy(), expected);
        assert_eq!(StudyError::Simulator(late().to_string()).remedy(), expected);
        assert_eq!(SimulationError::fatal("`x` ended").remedy(), None);
    }
}
