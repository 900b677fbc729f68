//! Messages of FMUs that cannot be used as twins.

use crate::storage::files::with_remedy;
use crate::study::StudyError;
use std::path::Path;

/// A problem of the file; the message says what is wrong and what to do.
pub(super) fn at(path: &Path, problem: impl std::fmt::Display) -> StudyError {
    StudyError::Simulator(format!("{}: {problem}", path.display()))
}

/// The system cannot read the file.
pub(super) fn io(path: &Path, error: &std::io::Error) -> StudyError {
    at(path, with_remedy(error))
}

/// The file is no FMU that can be used.
pub(super) fn archive(path: &Path, problem: &str) -> StudyError {
    at(path, format!("no usable FMU: {problem}; export it again"))
}

/// The library of the FMU cannot be loaded, or makes no instance.
pub(super) fn instance(path: &Path, problem: &str) -> StudyError {
    at(
        path,
        format!(
            "the FMU cannot be instantiated: {problem}; export it with a binary for this platform, for co-simulation"
        ),
    )
}
