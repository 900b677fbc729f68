//! A twin that is any program: it reads requests and writes answers, one line of JSON each.
//!
//! Nothing of this library is needed on the other side, in whatever language: `examples/pendulum.py` is a whole one.
//! `docs/external-programs.md` describes every field; in short:
//!
//! ```text
//! → {"truetwin": 1, "request": "describe"}
//! ← {"name": "lag", "parameters": [{"name": "tau", "unit": "s", "prior": [1, 3], "bounds": [0.1, 9]}],
//!    "inputs": [{"name": "u", "unit": "V"}], "outputs": [{"name": "y", "unit": "V"}],
//!    "record": {"step": 0.1, "samples": 300, "input": {"levels": [-1, 1], "hold": 20}}}
//! → {"request": "simulate", "id": 1, "theta": {"tau": 2.0}, "step": 0.1, "samples": 300,
//!    "inputs": {"u": [0.3, 0.3, …]}, "seed": 5012}
//! ← {"id": 1, "outputs": {"y": [0.0, 0.015, …]}}
//! ```
//!
//! or `{"id": 1, "diverged": 3.2}` (a time in seconds: this run is lost), or `{"id": 1, "error": "no licence"}` (the work
//! ends). `seed` is below 2⁵³; `null` asks for a run without noise. Values k belong to time k·Δt; input k acts from there to
//! (k + 1)·Δt. The same request must get the same answer, and draws must not depend on θ: runs with the same seed are
//! compared with each other.

mod description;
pub(crate) mod fuzzing;
mod health;
mod pool;
mod protocol;
mod running;
mod worker;

use super::check_call;
use crate::record::{Drive, Signal, Signals};
use crate::setting::SettingError;
use crate::study::{RecordPlan, Study, StudyError};
use crate::twin::{DigitalTwin, Noise, ParameterSpace, SimulationError};
use description::Description;
use health::Health;
use pool::{Pool, introduce};
use protocol::ProgramAnswer;
pub(crate) use running::end_all;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use worker::{ProgramCommand, Trouble};

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

/// An external program as a black box.
///
/// Copies of the program run side by side, at most [`ProgramSettings::workers`]; they start when they are needed and are
/// gone when the twin is dropped. A copy that ends or is late is replaced and its request asked again, so that the results
/// are those of a program that always answers.
///
/// | the program … | that costs |
/// |---|---|
/// | answers `diverged`, or a number that is not finite | this run ([`SimulationError::Diverged`]) |
/// | ends or is late, [`ProgramSettings::retries`] + 1 times | this run ([`SimulationError::Failed`]) |
/// | does so in each of the first 5 runs, or in 30 runs in a row at different θ | all ([`SimulationError::Fatal`]) |
/// | answers `error`, or what is no answer | all |
///
/// The results depend neither on the number of workers nor on restarts, as long as the program keeps its word that the same
/// request gets the same answer.
///
/// Then `truetwin::cli::run([study])` is a command line over it, and `truetwin --program 'python3 examples/pendulum.py'` is
/// the same without Rust.
pub struct ProgramTwin {
    pool: Pool,
    description: Description,
    retries: usize,
    requests: AtomicU64,
    health: Health,
}

impl std::fmt::Debug for ProgramTwin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ProgramTwin")
            .field("command", self.pool.command())
            .field("description", &self.description)
            .finish_non_exhaustive()
    }
}

impl ProgramTwin {
    /// Starts a first copy of the program and asks what it is. No shell is run: `*`, `|`, `$` and the like mean themselves.
    ///
    /// # Errors
    ///
    /// Settings out of range; a program that cannot be started, ends, is late, or does not describe a twin. The message
    /// has the end of its standard error.
    pub fn start<S: Into<String>>(
        program: &str,
        arguments: impl IntoIterator<Item = S>,
        settings: ProgramSettings,
    ) -> Result<Self, StudyError> {
        let command = ProgramCommand::new(program, arguments);
        settings.check()?;
        let most = (settings.workers).unwrap_or_else(rayon::current_num_threads);
        let introduced = introduce(&command, settings.timeout);
        let met = introduced.map_err(|error| command.not_started(&error))?;
        let (worker, description) =
            met.map_err(|trouble| command.not_described(&trouble.text()))?;
        let pool = Pool::new(command, settings.timeout, most);
        pool.adopt(worker);
        Ok(Self {
            pool,
            description,
            retries: settings.retries,
            requests: AtomicU64::new(1),
            health: Health::default(),
        })
    }

    /// The name that the program gives itself.
    pub fn name(&self) -> &str {
        &self.description.name
    }

    /// Step, length and input of its records, unless a study says otherwise.
    pub fn plan(&self) -> &RecordPlan {
        &self.description.record
    }

    /// The study of this twin with the program's own record plan.
    ///
    /// # Errors
    ///
    /// As [`Study::new`].
    pub fn into_study(self) -> Result<Study, StudyError> {
        let (name, plan) = (self.name().to_owned(), self.plan().clone());
        Study::new(&name, self, plan)
    }

    /// One request, asked of fresh workers until one answers or the attempts are used up.
    fn answer(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        let signals = &self.description.signals;
        let id = self.requests.fetch_add(1, Ordering::Relaxed);
        // Whole numbers up to 2⁵³ survive languages that know only floats.
        let seed = noise.seed().map(|seed| seed >> 11);
        let line = protocol::simulate(id, &self.description, theta, drive, seed);
        let longest = protocol::longest_answer(signals, drive.samples());
        let read = |answer: &str| protocol::answer(answer, id, signals, drive);
        let named = |problem: String| format!("`{}` {problem}", self.pool.command());
        let mut attempt = 0;
        loop {
            attempt += 1;
            let fresh = attempt > 1;
            match (self.pool).ask(&line, longest, fresh, &self.description, read) {
                Ok(ProgramAnswer::Error(text)) => {
                    return Err(self.health.broken(named(format!("says: {text}"))));
                }
                Ok(ProgramAnswer::Outputs(outputs)) => {
                    self.health.worked();
                    return Ok(outputs);
                }
                Ok(ProgramAnswer::Diverged(at)) => {
                    self.health.worked();
                    return Err(SimulationError::Diverged { at });
                }
                Err(Trouble::Nonsense(problem)) => {
                    return Err(self.health.broken(named(problem)));
                }
                Err(Trouble::Gone(_)) if attempt <= self.retries => self.health.check()?,
                Err(Trouble::Gone(problem)) => {
                    let tried = match attempt {
                        1 => String::new(),
                        _ => format!(" (attempt {attempt})"),
                    };
                    return Err(self
                        .health
                        .failed(theta, named(format!("{problem}{tried}"))));
                }
            }
        }
    }
}

impl DigitalTwin for ProgramTwin {
    fn parameters(&self) -> ParameterSpace {
        self.description.parameters.clone()
    }

    fn signals(&self) -> Signals {
        self.description.signals.clone()
    }

    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        self.health.check()?;
        let Description {
            parameters,
            signals,
            ..
        } = &self.description;
        check_call(parameters, signals, theta, drive)?;
        self.answer(theta, drive, noise)
    }
}
