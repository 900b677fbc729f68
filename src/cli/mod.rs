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
mod context;
mod external;
mod failure;
mod options;
mod output;
mod posterior;
mod prelude;
mod progress;
mod provenance;
mod records;
mod remedy;
mod say;
mod stop;
mod verbs;

use crate::estimator::Project;
use crate::storage::StorageError;
use crate::storage::work::Ranks;
use crate::study::StudyError;
use arguments::Arguments;
use clap::FromArgMatches;
use context::Context;
use failure::Failure;
use std::error::Error;
use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

/// Upper limit of --threads: larger numbers are typing errors.
const MOST_THREADS: usize = 1024;

/// Runs the command line of this process over studies or projects.
pub fn run<P: Into<Project>, E: Into<StudyError>>(
    projects: impl IntoIterator<Item = Result<P, E>>,
) -> ExitCode {
    run_from(projects, std::env::args_os())
}

/// Runs the command line `arguments`, the program's name first, over studies or projects.
fn run_from<P: Into<Project>, E: Into<StudyError>>(
    projects: impl IntoIterator<Item = Result<P, E>>,
    arguments: impl IntoIterator<Item = impl Into<OsString> + Clone>,
) -> ExitCode {
    let ranks = match Ranks::join() {
        Ok(ranks) => ranks,
        Err(error) => return Failure::from(error).report(),
    };
    let words: Vec<OsString> = arguments.into_iter().map(Into::into).collect();
    let matches = arguments::command().try_get_matches_from(&words);
    let parsed = match matches.and_then(|matches| Arguments::from_arg_matches(&matches)) {
        Ok(parsed) => parsed,
        Err(error) if !error.use_stderr() => {
            // Help and version are results.
            let shown = if ranks.is_root() {
                output::print(&error.to_string())
            } else {
                Ok(())
            };
            return shown.map_or_else(Failure::report, |()| ExitCode::SUCCESS);
        }
        Err(error) => return Failure::usage(&error).report_of(&ranks),
    };
    let verb = parsed.command.verb();
    if !ranks.is_alone() && !verb.is_shared_out() {
        let failure = Failure::user("this verb runs in one process; start it without mpirun");
        return failure.report_of(&ranks);
    }
    let program = (words.first())
        .and_then(|word| Some(Path::new(word).file_stem()?.to_str()?.to_owned()))
        .unwrap_or_else(|| "truetwin".into());
    let call = provenance::call(&program, &words);
    stop::listen();
    stop::report_file_size_limit();
    let projects: Result<Vec<Project>, E> = (projects.into_iter())
        .map(|project| project.map(Into::into))
        .collect();
    let result = projects
        .map_err(|error| Failure::from(error.into()))
        .and_then(|projects| {
            in_pool(parsed.threads, || {
                dispatch(&parsed, &program, call, &projects, &ranks)
            })
        });
    match result {
        Ok(code) => code,
        Err(_) if stop::asked() => {
            let exit = stop::failure(verb, &words).report_of(&ranks);
            ranks.abandon(stop::CODE);
            exit
        }
        Err(failure) => {
            let code = failure.code();
            let exit = failure.report();
            ranks.abandon(code);
            exit
        }
    }
}

/// Runs `work` in its own pool if a number of threads is given, else in the global one.
fn in_pool<R: Send>(
    threads: Option<usize>,
    work: impl FnOnce() -> Result<R, Failure> + Send,
) -> Result<R, Failure> {
    let builder = rayon::ThreadPoolBuilder::new();
    let failed = |threads, error| Failure::from(StorageError::threads(threads, error));
    match threads {
        None => match builder.build_global() {
            // An error without a cause says that the application has made the pool already.
            Err(error) if error.source().is_some() => {
                let cores = std::thread::available_parallelism().map_or(1, usize::from);
                Err(failed(cores, error))
            }
            _ => work(),
        },
        Some(threads) if !(1..=MOST_THREADS).contains(&threads) => Err(Failure::user(format!(
            "--threads {threads}: choose between 1 and {MOST_THREADS}"
        ))),
        Some(threads) => (builder.num_threads(threads).build())
            .map_err(|error| failed(threads, error))?
            .install(work),
    }
}

fn dispatch(
    arguments: &Arguments,
    program: &str,
    call: String,
    registered: &[Project],
    ranks: &Ranks,
) -> Result<ExitCode, Failure> {
    let progress = if ranks.is_root() {
        progress::bars()
    } else {
        progress::bars().unshown()
    };
    let external = external::study(&arguments.external, registered)?.map(Project::from);
    let projects: Vec<Project> = registered.iter().chain(&external).cloned().collect();
    let context = Context {
        projects: &projects,
        external: external.as_ref(),
        program,
        call,
        json: arguments.json,
        seed: arguments.seed,
        progress: &progress,
        ranks,
        command: arguments::command,
    };
    let verb = arguments.command.verb();
    if let Some(subject) = verb.subject() {
        context.check_external_is_used(subject)?;
    }
    let study = verb.subject().and_then(|subject| subject.study.as_deref());
    (verb.run(&context)).map_err(|failure| failure.of_study(study))
}
