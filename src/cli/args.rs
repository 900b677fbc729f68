//! The options of all verbs, and those that several share. What a verb has of its own stands in its file.

use super::Command as Verbs;
use crate::estimator::PresetName;
use clap::{Args, Command, CommandFactory, Parser, ValueEnum};
use std::path::PathBuf;
use std::time::Duration;

/// Calibrate a digital twin from a measured record, and be told when it cannot be trusted.
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
    /// Standard output is one JSON object.
    #[arg(long, global = true)]
    pub json: bool,
    /// Seed of everything random; the same seed gives the same bits on any number of threads.
    #[arg(long, global = true, default_value_t = 1)]
    pub seed: u64,
    /// Threads to use; all cores unless said.
    #[arg(long, global = true)]
    pub threads: Option<usize>,
    #[command(flatten)]
    pub external: External,
}

/// How a call ends; every `--help` says so.
const EXIT: &str = "Exit: 0 done, 2 the call or a file is wrong (one line says what, where and what to do), 130 stopped by Ctrl-C, \
     1 anything else.";

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

/// A twin from outside, for this call alone.
#[derive(Debug, Args)]
#[command(next_help_heading = "A simulator that is not in Rust")]
pub(super) struct External {
    /// A program that is a twin: it reads and writes lines of JSON. No shell is run.
    #[arg(long, global = true, value_name = "COMMAND")]
    pub program: Option<String>,
    /// An FMU that is a twin: FMI 2.0 or 3.0, co-simulation. Needs a build with the feature fmi.
    #[arg(long, global = true, value_name = "M.fmu", conflicts_with = "program")]
    pub fmu: Option<PathBuf>,
    /// Parameters, inputs and outputs of the FMU that the twin has; of a kind that none is named of, all.
    #[arg(long, global = true, value_name = "NAME,..", value_delimiter = ',')]
    pub variables: Vec<String>,
    /// Copies of the program or FMU that run at once; one a thread unless said.
    #[arg(long, global = true, value_name = "N")]
    pub workers: Option<usize>,
    /// Seconds that one answer of the program may take; 60 unless said.
    #[arg(long, global = true, value_name = "SECONDS")]
    pub timeout: Option<f64>,
}

/// Which twin, in which setting; of a call with `--program`, that program's unless said.
#[derive(Debug, Clone, Args)]
#[group(multiple = false)]
pub(super) struct Subject {
    /// A twin by name (see `truetwin twins`).
    #[arg(long)]
    pub twin: Option<String>,
    /// A twin in your own setting: a TOML file with step, prior, noise, limits, start, features.
    #[arg(long, value_name = "S.toml")]
    pub study: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum PresetArgument {
    /// As in the paper.
    Paper,
    /// What was found to be better, on any twin.
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

/// A number of runs.
pub(super) fn at_least_one(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("at least 1 is needed".into()),
        Ok(number) => Ok(number),
        Err(error) => Err(format!("{error}")),
    }
}

/// A length of time.
pub(super) fn seconds(text: &str) -> Result<Duration, String> {
    let number: f64 = text.parse().map_err(|error| format!("{error}"))?;
    Duration::try_from_secs_f64(number).map_err(|error| error.to_string())
}
