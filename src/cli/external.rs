//! The external twin of a call: `--program` or `--fmu`.

use super::failure::Failure;
use super::options::External;
use crate::estimator::Project;
use crate::external::program::{ProgramSettings, ProgramTwin};
use crate::setting::number;
use crate::study::Study;
use std::path::Path;
use std::time::Duration;

/// Returns the study of the program or FMU that the call names; `None` if it names none.
///
/// Only the command line can start foreign code; study files and estimators cannot.
pub(super) fn study(options: &External, registered: &[Project]) -> Result<Option<Study>, Failure> {
    check_options(options)?;
    let (what, study) = match (&options.program, &options.fmu) {
        (None, None) => return Ok(None),
        (Some(line), _) => (format!("the program `{line}`"), program(options, line)?),
        (None, Some(path)) => (path.display().to_string(), fmu(options, path)?),
    };
    let name = study.name();
    if registered.iter().any(|other| other.study().name() == name) {
        return Err(Failure::user(format!(
            "{what} names its twin \"{name}\", which is registered already; choose another name"
        )));
    }
    Ok(Some(study))
}

/// Refuses options without the program or FMU that they configure.
fn check_options(options: &External) -> Result<(), Failure> {
    let (program, fmu) = (options.program.is_some(), options.fmu.is_some());
    let problem = if program && fmu {
        "--fmu: give either --program or --fmu"
    } else if options.workers.is_some() && !program && !fmu {
        "--workers: needs a program or an FMU; add --program 'COMMAND' or --fmu M.fmu, or remove it"
    } else if options.timeout.is_some() && !program {
        "--timeout: needs a program; add --program 'COMMAND', or remove it"
    } else if !options.variables.is_empty() && !fmu {
        "--variables: needs an FMU; add --fmu M.fmu, or remove it"
    } else if options.co_simulation && !fmu {
        "--co-simulation: needs an FMU; add --fmu M.fmu, or remove it"
    } else {
        return Ok(());
    };
    Err(Failure::user(problem))
}

fn program(options: &External, line: &str) -> Result<Study, Failure> {
    let mut settings = ProgramSettings {
        workers: options.workers,
        ..ProgramSettings::default()
    };
    if let Some(seconds) = options.timeout {
        settings.timeout = Duration::try_from_secs_f64(seconds).map_err(|_| {
            Failure::user(format!(
                "--timeout {}: give a number of seconds above 0, up to a year",
                number(seconds)
            ))
        })?;
    }
    let (program, arguments) = command(line)?;
    Ok(ProgramTwin::start(&program, arguments, settings)?.into_study()?)
}

/// Splits a line into program and arguments at spaces; quotes and backslashes keep words together, as in a shell.
fn command(line: &str) -> Result<(String, Vec<String>), Failure> {
    let wrong = |problem: &str| Failure::user(format!("--program \"{line}\": {problem}"));
    let words = shell_words::split(line).map_err(|_| wrong("a quote is not closed; close it"))?;
    match words.split_first() {
        Some((program, arguments)) if !program.is_empty() => {
            Ok((program.clone(), arguments.to_vec()))
        }
        _ => Err(wrong("no program is named; write 'python3 model.py'")),
    }
}

#[cfg(feature = "fmi")]
fn fmu(options: &External, path: &Path) -> Result<Study, Failure> {
    use crate::external::fmu::{FmuSettings, FmuTwin};
    let settings = FmuSettings {
        variables: options.variables.clone(),
        workers: options.workers,
        co_simulation: options.co_simulation,
    };
    let twin = FmuTwin::open(path, settings).map_err(Failure::user)?;
    twin.into_study().map_err(Failure::user)
}

#[cfg(not(feature = "fmi"))]
fn fmu(_: &External, path: &Path) -> Result<Study, Failure> {
    Err(Failure::user(format!(
        "--fmu {}: this build cannot read FMUs; rebuild with `--features fmi`",
        path.display()
    )))
}
