//! Messages of programs that cannot be used as twins.

use super::command::ProgramCommand;
use crate::storage::files::with_remedy;
use crate::study::StudyError;

/// A setting out of its range.
pub(super) fn setting(problem: &str) -> StudyError {
    StudyError::Simulator(format!("the program's {problem}"))
}

/// The system cannot start the program.
pub(super) fn start(command: &ProgramCommand, error: &std::io::Error) -> StudyError {
    StudyError::Simulator(format!(
        "the program `{command}` cannot be started: {}",
        with_remedy(error)
    ))
}

/// The program does not describe itself.
pub(super) fn describe(command: &ProgramCommand, problem: &str) -> StudyError {
    StudyError::Simulator(format!(
        "the program `{command}` {problem}; asked to describe itself, it must answer one line of JSON with name, parameters, outputs and record, within the time-out"
    ))
}
