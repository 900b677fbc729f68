//! One command line over any twins.
//!
//! The `truetwin` binary hands it the reference twins; a user's three-line `main` hands it their own:
//!
//! ```no_run
//! use truetwin::study::{RecordPlan, Study};
//! use truetwin::twins::VanDerPol;
//!
//! fn main() -> std::process::ExitCode {
//!     truetwin::cli::run([Study::new("mine", VanDerPol, RecordPlan::autonomous(0.05, 300))])
//! }
//! ```
//!
//! Results go to standard output, progress and messages to standard error. Exit 0: done; 2: the call or a file is
//! wrong, in one line with the remedy; 1: anything else.

mod args;
mod bank;
mod check;
mod demo;
mod diagnose;
mod effects;
mod estimate;
mod external;
mod failure;
mod features;
mod merge;
mod output;
mod pretrain;
mod progress;
mod reproduce;
mod simulate;
mod stop;
mod twins;
mod withheld;

use crate::progress::Progress;
use crate::study::{Study, StudyError, StudyFile};
use crate::work::{Share, Team};
use args::{Arguments, Command, Subject};
use clap::{CommandFactory, FromArgMatches};
use failure::Failure;
use std::ffi::OsString;
use std::process::ExitCode;

/// More threads than any machine has cores are a slip of the keyboard.
const MOST_THREADS: usize = 1024;

/// Runs the command line of this process over `studies`.
pub fn run<E: Into<StudyError>>(studies: impl IntoIterator<Item = Result<Study, E>>) -> ExitCode {
    run_from(studies, std::env::args_os())
}

/// Runs the command line `arguments`, the program's name first, over `studies`.
pub fn run_from<E: Into<StudyError>>(
    studies: impl IntoIterator<Item = Result<Study, E>>,
    arguments: impl IntoIterator<Item = impl Into<OsString> + Clone>,
) -> ExitCode {
    let team = match Team::join() {
        Ok(team) => team,
        Err(error) => return Failure::from(error).report(),
    };
    let words: Vec<OsString> = arguments.into_iter().map(Into::into).collect();
    let matches = Arguments::command().try_get_matches_from(&words);
    let parsed = match matches.and_then(|matches| Arguments::from_arg_matches(&matches)) {
        Ok(parsed) => parsed,
        Err(error) if !error.use_stderr() => {
            // Help and version are results.
            let shown = match team.leads() {
                true => output::print(&error.to_string()),
                false => Ok(()),
            };
            return shown.map_or_else(Failure::report, |()| ExitCode::SUCCESS);
        }
        Err(error) => return Failure::usage(&error).report_of(&team),
    };
    if !team.is_alone() && !parsed.command.is_shared_out() {
        let failure = Failure::user("this verb runs as one process; start it without mpirun");
        return failure.report_of(&team);
    }
    stop::listen();
    let studies: Result<Vec<Study>, E> = studies.into_iter().collect();
    let result = studies
        .map_err(|error| Failure::from(error.into()))
        .and_then(|studies| in_pool(parsed.threads, || dispatch(&parsed, &studies, &team)));
    match result {
        Ok(code) => code,
        Err(_) if stop::asked() => {
            let exit = stop::failure(&parsed.command, &words).report_of(&team);
            team.abandon(stop::CODE);
            exit
        }
        Err(failure) => {
            let code = failure.code();
            let exit = failure.report();
            team.abandon(code);
            exit
        }
    }
}

/// Runs `work` in a pool of its own, where a number of threads is asked for; the global pool is left alone.
fn in_pool<R: Send>(
    threads: Option<usize>,
    work: impl FnOnce() -> Result<R, Failure> + Send,
) -> Result<R, Failure> {
    match threads {
        None => work(),
        Some(threads) if !(1..=MOST_THREADS).contains(&threads) => Err(Failure::user(format!(
            "--threads {threads}: choose between 1 and {MOST_THREADS}"
        ))),
        Some(threads) => rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(Failure::internal)?
            .install(work),
    }
}

fn dispatch(arguments: &Arguments, studies: &[Study], team: &Team) -> Result<ExitCode, Failure> {
    let progress = match team.leads() {
        true => progress::bars(),
        false => progress::bars().unshown(),
    };
    let external = external::study(&arguments.external, studies)?;
    let studies: Vec<Study> = studies.iter().chain(&external).cloned().collect();
    let context = Context {
        studies: &studies,
        external: external.as_ref(),
        json: arguments.json,
        seed: arguments.seed,
        progress: &progress,
        team,
    };
    let result = match &arguments.command {
        Command::Twins => twins::run(&context),
        Command::Effects(subject) => effects::run(&context, subject),
        Command::Check(subject) => check::run(&context, subject),
        Command::Simulate(options) => simulate::run(&context, options),
        Command::Bank(options) => bank::run(&context, options),
        Command::Features(options) => features::run(&context, options),
        Command::Merge(options) => merge::run(&context, options),
        Command::Pretrain(options) => pretrain::run(&context, options),
        Command::Estimate(options) => estimate::run(&context, options),
        Command::Diagnose(options) => diagnose::run(&context, options),
        Command::Reproduce(options) => reproduce::run(&context, options),
        Command::Withheld(options) => withheld::run(&context, options),
        Command::Demo(options) => demo::run(&context, options),
    };
    result.map_err(|failure| failure.of_study(arguments.command.study()))
}

/// What every verb sees.
struct Context<'a> {
    /// All there are, the external one among them.
    studies: &'a [Study],
    /// The one that this call brings along.
    external: Option<&'a Study>,
    json: bool,
    seed: u64,
    progress: &'a Progress,
    team: &'a Team,
}

impl Context<'_> {
    /// The study that `--twin` or `--study` names, else the one that the call brings along.
    fn study(&self, subject: &Subject) -> Result<Study, Failure> {
        match (&subject.twin, &subject.study) {
            (Some(name), _) => Ok(self.named(name)?.clone()),
            (None, Some(path)) => {
                let file = StudyFile::read(path).map_err(StudyError::from)?;
                let at = |failure: Failure| failure.within(path);
                let study = self.named(&file.twin).map_err(at)?;
                study.configure(&file).map_err(|error| at(error.into()))
            }
            (None, None) => (self.external.cloned()).ok_or_else(|| {
                Failure::user(
                    "no twin is named; give --twin NAME (`truetwin twins` lists them), --study S.toml, --program 'COMMAND', or --fmu M.fmu",
                )
            }),
        }
    }

    /// What this process does of numbered work: the part of `--shard`, or its rank's.
    fn share(&self, asked: Option<Share>) -> Result<Share, Failure> {
        match asked {
            None => Ok(self.team.share()),
            Some(share) if self.team.is_alone() => Ok(share),
            Some(_) => Err(Failure::user(
                "--shard is for jobs of their own; under mpirun the ranks share the work out themselves",
            )),
        }
    }

    fn named(&self, name: &str) -> Result<&Study, Failure> {
        let found = self.studies.iter().find(|study| study.name() == name);
        Ok(found.ok_or_else(|| StudyError::Twin {
            given: name.into(),
            known: self
                .studies
                .iter()
                .map(Study::name)
                .collect::<Vec<_>>()
                .join(", "),
        })?)
    }
}
