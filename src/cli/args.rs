//! Options of all verbs, and options that several verbs share.

use super::Command as Verbs;
use crate::estimator::PresetName;
use clap::{Args, Command, CommandFactory, Parser, ValueEnum};
use std::path::PathBuf;
use std::time::Duration;

/// Calibrate simulators against measured data and diagnose what they are missing.
#[derive(Debug, Parser)]
#[command(
    name = "truetwin",
    version,
    after_help = "A first look:   truetwin demo\n\
        The main job:   truetwin pretrain --twin tanks --out tanks.est\n                \
        truetwin estimate record.csv --estimator tanks.est --out result\n\
        Your simulator: truetwin check --program 'python3 model.py'   (docs/external-programs.md)\n\n\
        Records are CSV: t (seconds, uniform), inputs u or u1,u2,…, outputs y or y1,y2,…"
)]
pub(super) struct Arguments {
    #[command(subcommand)]
    pub command: Verbs,
    /// Print one JSON object.
    #[arg(long, global = true)]
    pub json: bool,
    /// Random seed; the same seed gives the same bits on any number of threads.
    #[arg(long, global = true, default_value_t = 1)]
    pub seed: u64,
    /// Number of threads [default: all cores].
    #[arg(long, global = true)]
    pub threads: Option<usize>,
    #[command(flatten)]
    pub external: External,
}

/// Exit codes, at the end of every `--help`.
const EXIT: &str = "Exit codes: 0 done; 2 wrong call or file (one line names the problem, the place and the remedy); 130 stopped by Ctrl-C; \
     1 internal error.";

/// The whole command line.
pub(super) fn command() -> Command {
    let with_exit = |command: Command| {
        let text = match command.get_after_help() {
            Some(text) => format!("{text}\n\n{EXIT}"),
            None => EXIT.into(),
        };
        command.after_help(text)
    };
    with_exit(Arguments::command()).mut_subcommands(with_exit)
}

/// An external twin, for this call alone.
#[derive(Debug, Args)]
#[command(next_help_heading = "External simulator")]
pub(super) struct External {
    /// Simulator program that reads and writes lines of JSON; started without a shell.
    #[arg(long, global = true, value_name = "COMMAND")]
    pub program: Option<String>,
    /// FMU (FMI 2.0 or 3.0, co-simulation); needs a build with the feature fmi.
    #[arg(long, global = true, value_name = "M.fmu", conflicts_with = "program")]
    pub fmu: Option<PathBuf>,
    /// Parameters, inputs and outputs to use from the FMU; if no variable of a kind is named, all of that kind are used.
    #[arg(long, global = true, value_name = "NAME,..", value_delimiter = ',')]
    pub variables: Vec<String>,
    /// Number of copies of the program or FMU that run at once [default: one per thread].
    #[arg(long, global = true, value_name = "N")]
    pub workers: Option<usize>,
    /// Time limit for one answer of the program [default: 60].
    #[arg(long, global = true, value_name = "SECONDS")]
    pub timeout: Option<f64>,
}

/// The twin and its setting; with `--program`, that program's twin by default.
#[derive(Debug, Clone, Args)]
#[group(multiple = false)]
pub(super) struct Subject {
    /// Name of a twin; `truetwin twins` lists them.
    #[arg(long)]
    pub twin: Option<String>,
    /// Study file (TOML): twin, step, prior, noise, limits, start, features.
    #[arg(long, value_name = "S.toml")]
    pub study: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum PresetArgument {
    /// The paper's recipe.
    Paper,
    /// The recipe that works best on any twin.
    Default,
}

impl From<PresetArgument> for PresetName {
    fn from(argument: PresetArgument) -> Self {
        match argument {
            PresetArgument::Paper => Self::Paper,
            PresetArgument::Default => Self::Default,
        }
    }
}

/// Parses a number of runs.
pub(super) fn at_least_one(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("choose at least 1".into()),
        Ok(number) => Ok(number),
        Err(error) => Err(format!("{error}")),
    }
}

/// Parses a duration in seconds.
pub(super) fn seconds(text: &str) -> Result<Duration, String> {
    let number: f64 = text.parse().map_err(|error| format!("{error}"))?;
    Duration::try_from_secs_f64(number).map_err(|error| error.to_string())
}
