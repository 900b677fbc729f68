//! The command that starts a program.

use crate::storage::files::with_remedy;
use crate::study::StudyError;
use std::process::Command;

/// A program and its arguments. No shell is run: `*`, `|`, `$` and the like mean themselves.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct ProgramCommand {
    program: String,
    arguments: Vec<String>,
}

impl ProgramCommand {
    /// The program and its arguments, each as it is.
    pub fn new<S: Into<String>>(program: &str, arguments: impl IntoIterator<Item = S>) -> Self {
        Self {
            program: program.into(),
            arguments: arguments.into_iter().map(Into::into).collect(),
        }
    }

    pub(super) fn command(&self) -> Command {
        let mut command = Command::new(&self.program);
        command.args(&self.arguments);
        // Ctrl-C is for us: we end the program.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        command
    }

    /// Creates the error of a program that the system cannot start.
    pub(super) fn not_started(&self, error: &std::io::Error) -> StudyError {
        StudyError::Simulator(format!(
            "the program `{self}` cannot be started: {}",
            with_remedy(error)
        ))
    }

    /// Creates the error of a program that does not describe itself.
    pub(super) fn not_described(&self, problem: &str) -> StudyError {
        StudyError::Simulator(format!(
            "the program `{self}` {problem}; asked to describe itself, it must answer one line of JSON with name, parameters, outputs and record, within the time-out"
        ))
    }
}

/// The words as they would be typed; those with spaces or quotes stand in quotes.
impl std::fmt::Display for ProgramCommand {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let plain = |c: char| c.is_alphanumeric() || "_-./=:,+@%".contains(c);
        let word = |word: &str| match !word.is_empty() && word.chars().all(plain) {
            true => word.to_owned(),
            false => format!("'{}'", word.replace('\'', r"'\''")),
        };
        f.write_str(&word(&self.program))?;
        (self.arguments.iter()).try_for_each(|argument| write!(f, " {}", word(argument)))
    }
}
