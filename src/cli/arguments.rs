//! The whole command line.

use super::options::External;
use super::verbs::Command as Verbs;
use clap::{Arg, Command, CommandFactory, Parser};

/// Calibrate simulators against measured data and diagnose what they are missing.
#[derive(Debug, Parser)]
#[command(
    name = "truetwin",
    version,
    after_help = "A first look:   truetwin demo\n\
        The main job:   truetwin pretrain --twin tanks --out tanks.est\n                \
        truetwin estimate record.csv --estimator tanks.est --out result\n\
        Your equations: truetwin new pendulum > pendulum.toml        (docs/equations.md)\n\
        Your simulator: truetwin check --program 'python3 model.py'   (docs/external-programs.md)\n\n\
        Records are CSV: t (seconds or time stamps), inputs u or u1,u2,…, outputs y or y1,y2,…; --columns for other names"
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
     1 a twin that fails its check, or an internal error.";

/// Creates the whole command line.
pub(super) fn command() -> Command {
    let with_exit = |command: Command| {
        let own = command.get_after_help().map(|text| format!("{text}\n\n"));
        let text = own.unwrap_or_default() + EXIT;
        command.after_help(text)
    };
    // `--seed -1` is a wrong number, not an unknown option.
    let signed = |argument: Arg| {
        let takes_value = argument.get_action().takes_values() && !argument.is_positional();
        argument.allow_negative_numbers(takes_value)
    };
    with_exit(Arguments::command().mut_args(signed))
        .mut_subcommands(|verb| with_exit(verb.mut_args(signed)))
}
