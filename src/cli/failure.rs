//! From any error to one line and an exit code.

use super::output;
use crate::diagnose::DiagnoseError;
use crate::effect::EffectError;
use crate::effect::EffectFileError;
use crate::estimator::EstimatorError;
use crate::evaluate::paper::{MonteCarloError, ScenarioError};
use crate::evaluate::trials::WithheldError;
use crate::feature::FeatureError;
use crate::network::NetworkError;
use crate::record::{CsvError, DriveError, RecordError};
use crate::storage::work::{Team, TeamError, WorkError};
use crate::study::{PlanError, StudyError};
use crate::twin::{AdaptationError, ParameterError, SimulationError};
use std::fmt::Display;
use std::path::Path;
use std::process::ExitCode;

/// The call or a file is wrong.
const USER: u8 = 2;
/// Anything else.
const INTERNAL: u8 = 1;

/// Why a verb ended early.
#[derive(Debug)]
pub(super) struct Failure {
    message: String,
    code: u8,
    /// Whether the study may be what is wrong.
    about_study: bool,
}

impl Failure {
    /// The user can mend it; the message says how.
    pub fn user(message: impl Display) -> Self {
        Self {
            message: message.to_string(),
            code: USER,
            about_study: false,
        }
    }

    /// The user cannot mend it.
    pub fn internal(message: impl Display) -> Self {
        Self {
            message: message.to_string(),
            code: INTERNAL,
            about_study: false,
        }
    }

    /// The user has stopped it.
    pub fn stopped(message: impl Display, code: u8) -> Self {
        Self {
            message: message.to_string(),
            code,
            about_study: false,
        }
    }

    /// A wrong call, in one line with the remedy.
    pub fn usage(error: &clap::Error) -> Self {
        use clap::error::{ContextKind, ContextValue, ErrorKind};
        if error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
            return Self::user("no verb given; see `truetwin --help`, or try `truetwin demo`");
        }
        let text = error.to_string();
        let first = text.split("\n\n").next().unwrap_or(&text);
        let line = first.split_whitespace().collect::<Vec<_>>().join(" ");
        let line = line.strip_prefix("error: ").unwrap_or(&line);
        let similar = [
            ContextKind::SuggestedSubcommand,
            ContextKind::SuggestedArg,
            ContextKind::SuggestedValue,
        ];
        let near = similar.iter().find_map(|kind| match error.get(*kind)? {
            ContextValue::String(name) => Some(name.clone()),
            ContextValue::Strings(names) => names.first().cloned(),
            _ => None,
        });
        let near = near.map_or(String::new(), |name| format!(" (did you mean {name}?)"));
        Self::user(format!(
            "{line}{near}; see `truetwin --help` and `truetwin VERB --help`"
        ))
    }

    /// Names the study file, where the study may be what is wrong.
    pub fn of_study(self, path: Option<&Path>) -> Self {
        match path {
            Some(path) if self.about_study => self.within(path),
            _ => self,
        }
    }

    /// Names the file that the message is about, unless it does.
    pub fn within(mut self, path: &Path) -> Self {
        let name = path.display().to_string();
        if !self.message.contains(&name) {
            self.message = format!("{name}: {}", self.message);
        }
        self
    }

    /// The exit code.
    pub fn code(&self) -> u8 {
        self.code
    }

    /// As [`report`](Self::report), of what every process of a team finds: one says it.
    pub fn report_of(self, team: &Team) -> ExitCode {
        match team.leads() {
            true => self.report(),
            false => ExitCode::from(self.code),
        }
    }

    /// Prints the line and gives the exit code.
    pub fn report(self) -> ExitCode {
        let line = self
            .message
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ");
        // What a message quotes may come from anywhere.
        output::say(&format!("error: {line}"));
        ExitCode::from(self.code)
    }
}

/// Errors that only the user's input can cause.
macro_rules! users {
    ($($error:ty),* $(,)?) => {
        $(impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                Self::user(error)
            }
        })*
    };
}
users!(
    AdaptationError,
    CsvError,
    DriveError,
    EffectError,
    EffectFileError,
    ParameterError,
    RecordError,
    SimulationError,
    TeamError,
    WorkError,
);

/// Errors that the setting of the study can cause.
macro_rules! studies {
    ($($error:ty),* $(,)?) => {
        $(impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                Self { about_study: true, ..Self::user(error) }
            }
        })*
    };
}
studies!(FeatureError, PlanError, StudyError);

impl From<WithheldError> for Failure {
    fn from(error: WithheldError) -> Self {
        match error {
            WithheldError::Diagnose(error) => error.into(),
            WithheldError::Threads(_) | WithheldError::Cancelled(_) => Self::internal(error),
            WithheldError::Changed(_)
            | WithheldError::NoEffect(_)
            | WithheldError::Runaway(_)
            | WithheldError::Plan(_) => Self {
                about_study: true,
                ..Self::user(error)
            },
            _ => Self::user(error),
        }
    }
}

impl From<NetworkError> for Failure {
    fn from(error: NetworkError) -> Self {
        match error {
            NetworkError::Backend(_) | NetworkError::Cancelled(_) => Self::internal(error),
            _ => Self::user(error),
        }
    }
}

impl From<EstimatorError> for Failure {
    fn from(error: EstimatorError) -> Self {
        use EstimatorError as E;
        match error {
            E::Study(error) => error.into(),
            E::Feature(error) => error.into(),
            E::Network(error) => error.into(),
            E::Cancelled(_) | E::Search(_) | E::Cloud(_) => Self::internal(error),
            E::Simulation(_) | E::Rejected(_) | E::Hopeless { .. } | E::Inputs(_) => Self {
                about_study: true,
                ..Self::user(error)
            },
            _ => Self::user(error),
        }
    }
}

impl From<DiagnoseError> for Failure {
    fn from(error: DiagnoseError) -> Self {
        match error {
            DiagnoseError::Cancelled(_) => Self::internal(error),
            _ => Self::user(error),
        }
    }
}

impl From<ScenarioError> for Failure {
    fn from(error: ScenarioError) -> Self {
        match error {
            ScenarioError::Plan(error) => error.into(),
            ScenarioError::Drive(error) => error.into(),
            ScenarioError::NoPoint(_) | ScenarioError::Outside { .. } => Self::user(error),
        }
    }
}

impl From<MonteCarloError> for Failure {
    fn from(error: MonteCarloError) -> Self {
        match error {
            MonteCarloError::Cancelled(_) | MonteCarloError::Threads(_) => Self::internal(error),
            MonteCarloError::Scenario(error) => error.into(),
            _ => Self::user(error),
        }
    }
}
