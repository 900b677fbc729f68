//! Calls of the command line within a process, for the fuzz tests.

use super::arguments::{Arguments, command};
use super::border;
use super::failure::{Failure, STOPPED};
use super::study_file;
use super::{Call, terminal};
use crate::estimator::Project;
use crate::progress::{Listener, Progress};
use crate::storage::work::Ranks;
use clap::FromArgMatches;
use std::ffi::OsString;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The end of a call.
#[derive(Debug)]
pub struct Ended {
    /// Exit code.
    pub code: u8,
    /// Text on standard output.
    pub printed: String,
    /// Text on standard error.
    pub said: String,
}

/// Runs a call over these twins in this process, one at a time; its work is cancelled after a time.
pub fn run(words: &[OsString], projects: &[Project], most: Duration) -> Ended {
    terminal::keep();
    let deadline = Progress::new(Arc::new(Deadline(Instant::now() + most)));
    let result = parsed(words, projects, &deadline);
    let code = match result {
        Ok(code) => number(code),
        Err(failure) => {
            let code = failure.code();
            let _ = failure.report();
            code
        }
    };
    let terminal::Written { printed, said } = terminal::taken();
    Ended {
        code,
        printed,
        said,
    }
}

fn parsed(
    words: &[OsString],
    projects: &[Project],
    progress: &Progress,
) -> Result<ExitCode, Failure> {
    let matches = command().try_get_matches_from(words);
    let matches = matches.map_err(|error| Failure::usage(&error))?;
    let arguments = Arguments::from_arg_matches(&matches);
    let call = Call {
        arguments: &arguments.map_err(|error| Failure::usage(&error))?,
        words,
        study_file: study_file(&matches),
        progress,
    };
    let ranks = Ranks::join()?;
    border::guarded(|| call.dispatch(projects, &ranks))
}

/// The number of an exit code, which only comparisons tell.
fn number(code: ExitCode) -> u8 {
    let codes = [0, 1, 2, STOPPED];
    let is = |number: &u8| ExitCode::from(*number) == code;
    codes.into_iter().find(is).unwrap_or(u8::MAX)
}

struct Deadline(Instant);

impl Listener for Deadline {
    fn advanced(&self, _: &str, _: u64, _: u64) {}

    fn cancelled(&self) -> bool {
        Instant::now() > self.0
    }
}
