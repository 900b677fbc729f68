//! Settings of a program.

use crate::setting::SettingError;
use crate::study::StudyError;
use std::time::Duration;

/// Most copies of a program.
const MOST_WORKERS: usize = 1024;
/// Most attempts at one simulation beside the first.
const MOST_RETRIES: usize = 100;
/// Longest time-out: a year.
const LONGEST: Duration = Duration::from_secs(366 * 24 * 3600);

/// Settings of a program.
///
/// | field | default | range | |
/// |---|---|---|---|
/// | `workers` | as many as threads simulate | 1 … 1024 | copies of the program that run at once |
/// | `timeout` | 60 s | above 0, at most a year | for one answer; the first one, the description, includes the start of the copy |
/// | `retries` | 2 | 0 … 100 | attempts on a fresh copy after one that ended or was late |
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProgramSettings {
    /// Copies of the program that run at once; `None`: one for each thread of the rayon pool that starts the twin.
    pub workers: Option<usize>,
    /// Longest time that one answer may take, the description included.
    pub timeout: Duration,
    /// Further attempts at a simulation whose worker ended or was late.
    pub retries: usize,
}

impl Default for ProgramSettings {
    fn default() -> Self {
        Self {
            workers: None,
            timeout: Duration::from_secs(60),
            retries: 2,
        }
    }
}

impl ProgramSettings {
    /// Checks whether each field is in its range.
    pub(super) fn check(&self) -> Result<(), StudyError> {
        if let Some(workers) = self.workers {
            let valid = (1..=MOST_WORKERS).contains(&workers);
            let remedy = format!("choose between 1 and {MOST_WORKERS}");
            SettingError::unless(valid, "workers", workers, remedy)?;
        }
        SettingError::unless(
            !self.timeout.is_zero() && self.timeout <= LONGEST,
            "timeout",
            self.timeout.as_secs_f64(),
            format!("choose more than 0 s, at most {} s", LONGEST.as_secs()),
        )?;
        let remedy = format!("choose at most {MOST_RETRIES}");
        SettingError::unless(
            self.retries <= MOST_RETRIES,
            "retries",
            self.retries,
            remedy,
        )?;
        Ok(())
    }
}
