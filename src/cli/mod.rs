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
//! Results go to standard output, progress and messages to standard error. Exit codes: 0 done; 2 wrong call or file, with
//! one line that has the remedy; 1 anything else.

mod arguments;
mod border;
mod context;
mod external;
mod failure;
pub(crate) mod fuzzing;
mod options;
mod output;
mod posterior;
mod prelude;
mod progress;
mod provenance;
mod records;
mod remedy;
mod shell_word;
mod stop;
mod terminal;
mod verbs;

use crate::estimator::Project;
use crate::progress::Progress;
use crate::storage::StorageError;
use crate::storage::work::Ranks;
use crate::study::StudyError;
use arguments::{Arguments, command};
use clap::{ArgMatches, FromArgMatches};
use context::Context;
use failure::{Failure, STOPPED};
use std::error::Error;
use std::ffi::OsString;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Upper limit of --threads: larger numbers are typing errors.
const MOST_THREADS: usize = 1024;

/// Runs the command line of this process over studies or projects.
pub fn run<P: Into<Project>, E: Into<StudyError>>(
    projects: impl IntoIterator<Item = Result<P, E>>,
) -> ExitCode {
    let projects: Result<Vec<Project>, StudyError> = (projects.into_iter())
        .map(|project| project.map(Into::into).map_err(Into::into))
        .collect();
    border::on_own_stack(|| answer(projects)).unwrap_or_else(Failure::report)
}

/// Answers the call of this process.
fn answer(projects: Result<Vec<Project>, StudyError>) -> ExitCode {
    let ranks = match Ranks::join() {
        Ok(ranks) => ranks,
        Err(error) => return Failure::from(error).report(),
    };
    let words: Vec<OsString> = std::env::args_os().collect();
    let parsed = command()
        .try_get_matches_from(&words)
        .and_then(|matches| Ok((Arguments::from_arg_matches(&matches)?, study_file(&matches))));
    let (arguments, study_file) = match parsed {
        Ok(parsed) => parsed,
        // Help and version are results.
        Err(shown) if !shown.use_stderr() => {
            let printed = match ranks.is_root() {
                true => output::print(&shown.to_string()),
                false => Ok(()),
            };
            return printed.map_or_else(Failure::report, |()| ExitCode::SUCCESS);
        }
        Err(error) => return Failure::usage(&error).report_of(&ranks),
    };
    let verb = arguments.command.verb();
    if !ranks.is_alone() && !verb.is_shared_out() {
        let failure = Failure::user("this verb runs in one process; start it without mpirun");
        return failure.report_of(&ranks);
    }
    stop::listen(verb, &words);
    border::keep_quiet();
    stop::report_file_size_limit();
    let result = projects.map_err(Failure::from).and_then(|projects| {
        let progress = progress::bars();
        let call = Call {
            arguments: &arguments,
            words: &words,
            study_file,
            progress: &progress,
        };
        let work = || in_pool(arguments.threads, || call.dispatch(&projects, &ranks));
        border::guarded(work)
    });
    let result = result.map(|code| match code == ExitCode::SUCCESS && stop::asked() {
        true => {
            output::say("stopped when the result was complete");
            ExitCode::from(STOPPED)
        }
        false => code,
    });
    result.unwrap_or_else(|failure| {
        let (code, exit) = match stop::asked() {
            true => (STOPPED, stop::failure().report_of(&ranks)),
            false => (failure.code(), failure.report()),
        };
        ranks.abandon(code);
        exit
    })
}

/// Returns the study file of a call.
fn study_file(matches: &ArgMatches) -> Option<PathBuf> {
    let (_, verb) = matches.subcommand()?;
    verb.try_get_one("study").ok().flatten().cloned()
}

/// Runs `work` in its own pool if a number of threads is given, else in the global one.
fn in_pool<R: Send>(
    threads: Option<usize>,
    work: impl FnOnce() -> Result<R, Failure> + Send,
) -> Result<R, Failure> {
    let builder = rayon::ThreadPoolBuilder::new();
    let failed =
        |threads, error: &dyn Display| Failure::from(StorageError::threads(threads, error));
    let of_environment = std::env::var("RAYON_NUM_THREADS").ok();
    let asked = match threads {
        Some(threads) => Some(("--threads ", threads)),
        None => (of_environment.and_then(|n| n.parse().ok()))
            // As rayon takes it: all cores.
            .filter(|threads| *threads != 0)
            .map(|threads| ("RAYON_NUM_THREADS=", threads)),
    };
    if let Some((of, threads)) = asked.filter(|(_, n)| !(1..=MOST_THREADS).contains(n)) {
        return Err(Failure::user(format!(
            "{of}{threads}: choose between 1 and {MOST_THREADS}"
        )));
    }
    match threads {
        None => match builder.build_global() {
            // An error without a cause says that the application has made the pool already.
            Err(error) if error.source().is_some() => {
                let cores = std::thread::available_parallelism().map_or(1, usize::from);
                Err(failed(cores, &error))
            }
            _ => work(),
        },
        Some(threads) => {
            // A thread that begins where memory ends takes the process with it: there must be 2 MiB for each stack, and as much beside it.
            let mut room = Vec::<u8>::new();
            (room.try_reserve_exact(threads << 22)).map_err(|error| failed(threads, &error))?;
            drop(std::hint::black_box(room));
            (builder.num_threads(threads).build())
                .map_err(|error| failed(threads, &error))?
                .install(work)
        }
    }
}

/// A call of the program.
struct Call<'a> {
    arguments: &'a Arguments,
    words: &'a [OsString],
    study_file: Option<PathBuf>,
    progress: &'a Progress,
}

impl Call<'_> {
    fn dispatch(self, registered: &[Project], ranks: &Ranks) -> Result<ExitCode, Failure> {
        let progress = match ranks.is_root() {
            true => self.progress.clone(),
            false => self.progress.unshown(),
        };
        let arguments = self.arguments;
        let external = external::study(&arguments.external, registered)?.map(Project::from);
        let projects: Vec<Project> = registered.iter().chain(&external).cloned().collect();
        let program = (self.words.first())
            .and_then(|word| Path::new(word).file_stem()?.to_str())
            .unwrap_or("truetwin");
        let context = Context {
            projects: &projects,
            external: external.as_ref(),
            program,
            call: provenance::call(program, self.words),
            study_file: self.study_file,
            json: arguments.json,
            seed: arguments.seed,
            progress: &progress,
            ranks,
            command,
        };
        let run = || arguments.command.verb().run(&context);
        let result = match &external {
            Some(external) => external.study().twin().side_by_side(run),
            None => run(),
        };
        result.map_err(|failure| failure.of_study(context.study_file.as_deref()))
    }
}
