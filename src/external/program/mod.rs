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
//! ends). A description may also show the twin's equations, as text or for blocks of points (`inside.rs`, `frame.rs`). `seed` is below 2⁵³; `null` asks for a run without noise. Values k belong to time k·Δt; input k acts from there to
//! (k + 1)·Δt. The same request must get the same answer, and draws must not depend on θ: runs with the same seed are
//! compared with each other.

mod asking;
mod description;
mod frame;
pub(crate) mod fuzzing;
mod health;
mod inside;
mod once_each;
mod pool;
mod protocol;
mod running;
mod served;
mod shared;
mod worker;

use super::check_call;
use crate::record::{Drive, Signal, Signals};
use crate::setting::SettingError;
use crate::study::{RecordPlan, Study, StudyError};
use crate::twin::{Composed, DigitalTwin, Noise, ParameterSpace, SimulationError};
use asking::{Asker, Reply};
use pool::{Pool, ProgramRequest, introduce};
use protocol::ProgramAnswer;
pub(crate) use running::end_all;
use served::ServedEquations;
use std::sync::Arc;
use std::time::Duration;
#[cfg(feature = "cli")]
pub(crate) use worker::LATE;
use worker::ProgramCommand;

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

/// An external program: a black box, or, where its description shows the equations, a twin with states.
///
/// | the description has … | the twin |
/// |---|---|
/// | outputs alone | a black box; the program is asked for each run |
/// | the tables of a text, as JSON | the [`Equations`](crate::equations::Equations) of that text; the program is asked nothing more |
/// | these, and `serves` | equations, of which the program computes rates or outputs for many points in one exchange |
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
    asker: Arc<Asker>,
    /// The equations that the program computes.
    served: Option<Arc<ServedEquations>>,
}

impl std::fmt::Debug for ProgramTwin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ProgramTwin")
            .field("command", self.asker.pool.command())
            .field("description", &self.asker.description)
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
        let asker = Arc::new(Asker::new(pool, description, settings.retries));
        let inside = asker.description.inside.as_ref();
        let served = (inside.filter(|inside| !inside.serves.is_empty()))
            .map(|inside| Arc::new(ServedEquations::new(asker.clone(), inside)));
        Ok(Self { asker, served })
    }

    /// The name that the program gives itself.
    pub fn name(&self) -> &str {
        &self.asker.description.name
    }

    /// Step, length and input of its records, unless a study says otherwise; `None` where a program that shows its equations leaves them out.
    pub fn plan(&self) -> Option<&RecordPlan> {
        self.asker.description.record.as_ref()
    }

    /// The study of this twin with the program's own record plan.
    ///
    /// # Errors
    ///
    /// As [`Study::new`].
    pub fn into_study(self) -> Result<Study, StudyError> {
        let asker = self.asker.clone();
        match (&asker.description.inside, self.plan()) {
            (Some(inside), _) => {
                let study = match inside.serves.is_empty() {
                    true => Study::of_file(&inside.file)?,
                    false => Study::of_file_with(&inside.file, self)?,
                };
                Ok(match inside.simulates {
                    true => study.with_own_runs(Arc::new(ProgramRuns(asker.clone()))),
                    false => study,
                })
            }
            (None, Some(plan)) => {
                let (name, plan) = (self.name().to_owned(), plan.clone());
                Study::new(&name, self, plan)
            }
            (None, None) => Err(StudyError::NoPlan),
        }
    }

    /// The equations, if the program shows them.
    fn shown(&self) -> Option<Composed> {
        let inside = self.asker.description.inside.as_ref()?;
        Some(match &self.served {
            Some(served) => served.composed(inside),
            None => inside.equations.composed(),
        })
    }
}

/// Runs of the program, as a black box.
struct ProgramRuns(Arc<Asker>);

impl DigitalTwin for ProgramRuns {
    fn parameters(&self) -> ParameterSpace {
        self.0.description.parameters.clone()
    }

    fn signals(&self) -> Signals {
        self.0.description.signals.clone()
    }

    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        let (asker, description) = (&self.0, &self.0.description);
        asker.health.check()?;
        check_call(&description.parameters, &description.signals, theta, drive)?;
        let signals = &description.signals;
        let id = asker.next_id();
        // Whole numbers up to 2⁵³ survive languages that know only floats.
        let seed = noise.seed().map(|seed| seed >> 11);
        let line = protocol::simulate(id, description, theta, drive, seed);
        let request = ProgramRequest {
            bytes: line.into_bytes(),
            longest: protocol::longest_answer(signals, drive.samples()),
        };
        let read = |answer: &str| {
            let reply = match protocol::answer(answer, id, signals, drive)? {
                ProgramAnswer::Outputs(outputs) => Reply::Good(Ok(outputs), 0),
                ProgramAnswer::Diverged(at) => Reply::Good(Err(at), 0),
                ProgramAnswer::Error(text) => Reply::Error(text),
            };
            Ok(reply)
        };
        let (outputs, _) = asker.ask(theta, &request, read)?;
        asker.health.worked();
        outputs.map_err(|at| SimulationError::Diverged { at })
    }
}

impl DigitalTwin for ProgramTwin {
    fn parameters(&self) -> ParameterSpace {
        self.asker.description.parameters.clone()
    }

    fn signals(&self) -> Signals {
        self.asker.description.signals.clone()
    }

    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        match self.shown() {
            Some(equations) => equations.run(theta, drive, noise),
            None => ProgramRuns(self.asker.clone()).simulate(theta, drive, noise),
        }
    }

    fn equations(self: Arc<Self>) -> Option<Composed> {
        self.shown()
    }
}
