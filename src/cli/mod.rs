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
mod shell;
mod simulate;
mod stop;
mod twins;
mod withheld;

use crate::estimator::Project;
use crate::progress::Progress;
use crate::storage::work::{Share, Team};
use crate::study::{Study, StudyError, StudyFile};
use args::{Arguments, Subject};
use clap::{FromArgMatches, Subcommand};
use failure::Failure;
use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

/// More threads than any machine has cores are a slip of the keyboard.
const MOST_THREADS: usize = 1024;

/// Runs the command line of this process over studies or projects.
pub fn run<P: Into<Project>, E: Into<StudyError>>(
    projects: impl IntoIterator<Item = Result<P, E>>,
) -> ExitCode {
    run_from(projects, std::env::args_os())
}

/// Runs the command line `arguments`, the program's name first, over studies or projects.
///
/// ```
/// use std::process::ExitCode;
/// use truetwin::study::{RecordPlan, Study};
/// use truetwin::twins::VanDerPol;
///
/// let studies = [Study::new("mine", VanDerPol, RecordPlan::autonomous(0.05, 300))];
/// let code = truetwin::cli::run_from(studies, ["mine", "twins", "--json"]);
/// assert_eq!(code, ExitCode::SUCCESS);
/// ```
pub fn run_from<P: Into<Project>, E: Into<StudyError>>(
    projects: impl IntoIterator<Item = Result<P, E>>,
    arguments: impl IntoIterator<Item = impl Into<OsString> + Clone>,
) -> ExitCode {
    let team = match Team::join() {
        Ok(team) => team,
        Err(error) => return Failure::from(error).report(),
    };
    let words: Vec<OsString> = arguments.into_iter().map(Into::into).collect();
    let matches = args::command().try_get_matches_from(&words);
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
    let verb = parsed.command.verb();
    if !team.is_alone() && !verb.is_shared_out() {
        let failure = Failure::user("this verb runs as one process; start it without mpirun");
        return failure.report_of(&team);
    }
    let program = (words.first())
        .and_then(|word| Some(Path::new(word).file_stem()?.to_str()?.to_owned()))
        .unwrap_or_else(|| "truetwin".into());
    stop::listen();
    let projects: Result<Vec<Project>, E> = (projects.into_iter())
        .map(|project| project.map(Into::into))
        .collect();
    let result = projects
        .map_err(|error| Failure::from(error.into()))
        .and_then(|projects| {
            in_pool(parsed.threads, || {
                dispatch(&parsed, &program, &projects, &team)
            })
        });
    match result {
        Ok(code) => code,
        Err(_) if stop::asked() => {
            let exit = stop::failure(verb, &words).report_of(&team);
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

fn dispatch(
    arguments: &Arguments,
    program: &str,
    registered: &[Project],
    team: &Team,
) -> Result<ExitCode, Failure> {
    let progress = match team.leads() {
        true => progress::bars(),
        false => progress::bars().unshown(),
    };
    let external = external::study(&arguments.external, registered)?.map(Project::from);
    let projects: Vec<Project> = registered.iter().chain(&external).cloned().collect();
    let context = Context {
        projects: &projects,
        external: external.as_ref(),
        program,
        json: arguments.json,
        seed: arguments.seed,
        progress: &progress,
        team,
    };
    let verb = arguments.command.verb();
    let study = verb.subject().and_then(|subject| subject.study.as_deref());
    (verb.run(&context)).map_err(|failure| failure.of_study(study))
}

/// The verbs, in the order of `--help`. Each is one file, and three lines here: its `mod`, its variant, its arm.
#[derive(Debug, Subcommand)]
enum Command {
    Twins(twins::Twins),
    Effects(effects::Effects),
    Check(check::Check),
    Simulate(simulate::Simulate),
    Bank(bank::Bank),
    Features(features::Features),
    Merge(merge::Merge),
    Pretrain(pretrain::Pretrain),
    Estimate(estimate::Estimate),
    Diagnose(diagnose::Diagnose),
    Reproduce(reproduce::Reproduce),
    Withheld(withheld::Withheld),
    Demo(demo::Demo),
    Completions(shell::Completions),
    Man(shell::Man),
}

impl Command {
    fn verb(&self) -> &dyn Verb {
        match self {
            Self::Twins(verb) => verb,
            Self::Effects(verb) => verb,
            Self::Check(verb) => verb,
            Self::Simulate(verb) => verb,
            Self::Bank(verb) => verb,
            Self::Features(verb) => verb,
            Self::Merge(verb) => verb,
            Self::Pretrain(verb) => verb,
            Self::Estimate(verb) => verb,
            Self::Diagnose(verb) => verb,
            Self::Reproduce(verb) => verb,
            Self::Withheld(verb) => verb,
            Self::Demo(verb) => verb,
            Self::Completions(verb) => verb,
            Self::Man(verb) => verb,
        }
    }
}

/// A verb: the options of a call, and what is done with them.
trait Verb {
    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure>;

    /// Which twin it is about, where it asks.
    fn subject(&self) -> Option<&Subject> {
        None
    }

    /// Whether the same call goes on where this one stopped.
    fn is_resumed(&self) -> bool {
        false
    }

    /// Whether the ranks of a cluster share its work.
    fn is_shared_out(&self) -> bool {
        false
    }
}

/// What every verb sees.
struct Context<'a> {
    /// All there are, the external one among them.
    projects: &'a [Project],
    /// The one that this call brings along.
    external: Option<&'a Project>,
    /// What the command is called.
    program: &'a str,
    json: bool,
    seed: u64,
    progress: &'a Progress,
    team: &'a Team,
}

impl Context<'_> {
    /// The study that `--twin` or `--study` names, else the one that the call brings along.
    fn study(&self, subject: &Subject) -> Result<Study, Failure> {
        Ok(self.project(subject)?.study().clone())
    }

    /// As [`study`](Self::study), with the recipes.
    fn project(&self, subject: &Subject) -> Result<Project, Failure> {
        match (&subject.twin, &subject.study) {
            (Some(name), _) => Ok(self.named(name)?.clone()),
            (None, Some(path)) => {
                let file = StudyFile::read(path).map_err(StudyError::from)?;
                let at = |failure: Failure| failure.within(path);
                let project = self.named(&file.twin).map_err(at)?;
                project.configure(&file).map_err(|error| at(error.into()))
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

    fn named(&self, name: &str) -> Result<&Project, Failure> {
        let project = (self.projects.iter()).find(|project| project.study().name() == name);
        Ok(project.ok_or_else(|| StudyError::Twin {
            given: name.into(),
            known: self
                .projects
                .iter()
                .map(|project| project.study().name())
                .collect::<Vec<_>>()
                .join(", "),
        })?)
    }
}
