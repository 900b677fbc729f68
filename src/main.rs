//! The `truetwin` program: the command line over the reference twins.

use std::process::ExitCode;
use truetwin::estimator::Project;
use truetwin::study::StudyError;

fn main() -> ExitCode {
    match truetwin::evaluate::paper::reference_projects() {
        Ok(projects) => truetwin::cli::run(projects.into_iter().map(Ok::<_, StudyError>)),
        Err(error) => truetwin::cli::run([Err::<Project, _>(error)]),
    }
}
