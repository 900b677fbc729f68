//! Messages on standard error; errors as one line and an exit code.

use super::remedy::{Cause, Remedy};
pub(super) use super::terminal::say;
use crate::storage::untrusted::{one_line, short_words};
use crate::storage::work::Ranks;
use crate::study::StudyError;
use std::fmt::{self, Display, Formatter};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Most characters of a message: it may quote what was given.
const LONGEST: usize = 2000;
/// Exit code of a process stopped by Ctrl-C.
pub(super) const STOPPED: u8 = 130;

/// Words of the standard library for text that is no number, and what is expected in place of it.
const NUMBERS: [(&str, &str); 6] = [
    ("invalid digit found in string", WHOLE),
    ("cannot parse integer from empty string", WHOLE),
    (
        "number too large to fit in target type",
        "expected a smaller whole number",
    ),
    ("number too small to fit in target type", WHOLE),
    ("invalid float literal", "expected a number, such as 0.5"),
    (
        "cannot parse float from empty string",
        "expected a number, such as 0.5",
    ),
];
const WHOLE: &str =
    "expected a whole number in digits, such as 100, without sign, point or exponent";

/// The reason why a verb ended early.
#[derive(Debug)]
pub(super) struct Failure {
    message: String,
    cause: Cause,
}

impl Failure {
    /// Creates a failure that the user can fix; the message tells how.
    pub fn user(message: impl Display) -> Self {
        Self::new(message, Cause::Call)
    }

    /// Creates a failure that the user cannot fix.
    pub fn internal(message: impl Display) -> Self {
        Self::new(message, Cause::Internal)
    }

    pub fn new(message: impl Display, cause: Cause) -> Self {
        let message = message.to_string();
        Self { message, cause }
    }

    /// Creates the failure of a diagnosis: its records or options are wrong, the study file was accepted.
    pub fn diagnosis(error: StudyError) -> Self {
        let failure = Self::from(error);
        match failure.cause {
            Cause::Study => Self {
                cause: Cause::Call,
                ..failure
            },
            _ => failure,
        }
    }

    /// Creates the failure of one of several records as that of its file, and as `whole` any other.
    pub fn of_records(
        error: StudyError,
        whole: impl FnOnce(StudyError) -> Self,
        records: &[PathBuf],
        validation: Option<&PathBuf>,
    ) -> Self {
        let path = error.culprit(records, validation);
        let failure = match error {
            StudyError::Channels { error, .. } => Self::from(error),
            other => whole(other),
        };
        path.into_iter()
            .fold(failure, |failure, path| failure.within(path))
    }

    /// Creates the failure of a wrong call, in one line with the remedy.
    pub fn usage(error: &clap::Error) -> Self {
        use clap::error::{ContextKind, ContextValue, ErrorKind};
        if error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
            return Self::user("no verb given; see `truetwin --help`, or try `truetwin demo`");
        }
        let text = error.to_string();
        let first = text.split("\n\n").next().unwrap_or(&text);
        let line = first.split_whitespace().collect::<Vec<_>>().join(" ");
        let line = line.strip_prefix("error: ").unwrap_or(&line).to_owned();
        let line = (NUMBERS.iter()).fold(line, |line, (library, ours)| line.replace(library, ours));
        let similar = [
            ContextKind::SuggestedSubcommand,
            ContextKind::SuggestedArg,
            ContextKind::SuggestedValue,
        ];
        let near = similar.iter().find_map(|kind| match error.get(*kind)? {
            ContextValue::String(name) => Some(name.clone()),
            // Sorted by confidence: the nearest name is the last one.
            ContextValue::Strings(names) => names.last().cloned(),
            _ => None,
        });
        let near = near.map_or(String::new(), |name| format!(" (did you mean {name}?)"));
        Self::user(format!(
            "{line}{near}; see `truetwin --help` and `truetwin VERB --help`"
        ))
    }

    /// Adds the study file if it may be the cause.
    pub fn of_study(self, path: Option<&Path>) -> Self {
        match path {
            Some(path) if matches!(self.cause, Cause::Study) => self.within(path),
            _ => self,
        }
    }

    /// Adds what follows from it.
    pub fn and(mut self, more: &str) -> Self {
        self.message = format!("{}; {more}", self.message);
        self
    }

    /// Adds the name of the file unless the message has it.
    pub fn within(mut self, path: &Path) -> Self {
        let name = path.display().to_string();
        // A remedy may name a file of the same name, a column may have it.
        let begins = [":", ","].map(|end| format!("{name}{end}"));
        let is_path = name.contains(['.', '/']);
        let named = (begins.iter()).any(|begin| {
            self.message.starts_with(begin)
                || is_path && self.message.contains(&format!(" {begin}"))
        });
        if !named {
            self.message = format!("{name}: {}", self.message);
        }
        self
    }

    /// The exit code.
    pub fn code(&self) -> u8 {
        match self.cause {
            Cause::Call | Cause::Study => 2,
            Cause::Internal => 1,
            Cause::Stop => STOPPED,
        }
    }

    /// Reports a failure that all ranks share; the root rank prints it.
    pub fn report_of(self, ranks: &Ranks) -> ExitCode {
        match ranks.is_root() {
            true => self.report(),
            false => ExitCode::from(self.code()),
        }
    }

    /// Prints the line and gives the exit code.
    pub fn report(self) -> ExitCode {
        // Its end is the remedy.
        let message = match self.message.chars().nth(LONGEST) {
            Some(_) => &short_words(&self.message),
            None => &self.message,
        };
        say(&format!("error: {}", one_line(message, LONGEST)));
        ExitCode::from(self.code())
    }
}

impl Display for Failure {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl<E: Remedy + Display> From<E> for Failure {
    fn from(error: E) -> Self {
        let message = match error.remedy() {
            Some(remedy) => format!("{error} ({remedy})"),
            None => error.to_string(),
        };
        Self::new(message, error.cause())
    }
}

/// Adds the file that an error is about.
pub(super) trait InFile<T> {
    fn in_file(self, path: &Path) -> Result<T, Failure>;
}

impl<T, E: Into<Failure>> InFile<T> for Result<T, E> {
    fn in_file(self, path: &Path) -> Result<T, Failure> {
        self.map_err(|error| error.into().within(path))
    }
}
