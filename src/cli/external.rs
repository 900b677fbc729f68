//! A twin that only this call knows: `--program`.

use super::Failure;
use super::args::External;
use crate::external::program::{ProgramCommand, ProgramError, ProgramSettings, ProgramTwin};
use crate::study::Study;
use std::time::Duration;

/// The study of the program that the call names, beside `registered` ones; `None` where it names none.
///
/// A program is started here and nowhere else: no study file and no estimator can name one.
pub(super) fn study(options: &External, registered: &[Study]) -> Result<Option<Study>, Failure> {
    let Some(line) = &options.program else {
        let unused = [
            ("--workers", options.workers.is_some()),
            ("--timeout", options.timeout.is_some()),
        ];
        return match unused.iter().find(|(_, given)| *given) {
            Some((name, _)) => Err(Failure::user(format!(
                "{name} is about a program; give --program 'COMMAND', or leave it out"
            ))),
            None => Ok(None),
        };
    };
    let mut settings = ProgramSettings {
        workers: options.workers,
        ..ProgramSettings::default()
    };
    if let Some(seconds) = options.timeout {
        settings.timeout = Duration::try_from_secs_f64(seconds).map_err(|_| {
            Failure::user(format!(
                "--timeout {seconds}: give a positive number of seconds"
            ))
        })?;
    }
    let twin = ProgramTwin::start(ProgramCommand::parse(line)?, settings)?;
    let name = twin.name();
    if registered.iter().any(|study| study.name() == name) {
        return Err(Failure::user(format!(
            "the program `{line}` calls its twin \"{name}\", which is registered already; let it answer another name"
        )));
    }
    Ok(Some(twin.into_study()?))
}

impl From<ProgramError> for Failure {
    fn from(error: ProgramError) -> Self {
        Self::user(error)
    }
}
