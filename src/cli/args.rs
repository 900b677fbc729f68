//! The verbs and their options.

use crate::experiment::Scenario;
use crate::study::PresetName;
use crate::withheld::Kind;
use crate::work::Share;
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::{Path, PathBuf};
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
        Records are CSV: t (seconds, uniform), inputs u or u1,u2,…, outputs y or y1,y2,…\n\
        Exit: 0 done, 2 the call or a file is wrong (one line says what, where and what to do), 1 anything else."
)]
pub(super) struct Arguments {
    #[command(subcommand)]
    pub command: Command,
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

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// List the twins: parameters, units, prior, bounds, channels.
    Twins,
    /// List the effects that a twin may lack, with their targets and magnitudes.
    Effects(Subject),
    /// Check a twin before any training: repeatable, paired noise, finite, identifiable.
    Check(Subject),
    /// Simulate a record.
    Simulate(SimulateOptions),
    /// Simulate a bank from the prior onto the disk; run again, it goes on where it stopped.
    ///
    /// DIR holds manifest.json and shards/*.npz, each shard with `theta` and `features`, for `pretrain --bank DIR` or numpy.load.
    /// Row i depends on the seed and i alone: any number of threads, jobs (--shard) and ranks (mpirun) makes the same bytes.
    Bank(BankArguments),
    /// Compress records to features, as a network would see them.
    Features(FeaturesArguments),
    /// Put the banks of a job array together, or turn a bank into one .npz or .csv file.
    Merge(MergeArguments),
    /// Simulate a bank from the prior, train the network, write one estimator file.
    Pretrain(PretrainArguments),
    /// Estimate the parameters behind a measured record.
    Estimate(EstimateArguments),
    /// Learn what the twin lacks: whether parameters can explain the record, where not, which effect, how far it closes the gap.
    ///
    /// Needs no training. DIR holds report.json, report.html and, where another record would tell rivals apart,
    /// next-input.csv. Of a twin that shows no equations, only effects of sensors and actuators can be named.
    Diagnose(DiagnoseArguments),
    /// Score every method on simulated records: the paper's table and figures.
    ///
    /// Methods: the pretrained network (TS-pre), Gauss–Newton (GN), tuned heads (TS-fine), what `estimate` would answer
    /// (final), and as baselines the prediction-error method (PEM) and the dual Kalman filter (dual-EKF), each from a good
    /// start, from TS-pre, and from a bad start. Where the paper has a figure, it stands beside ours. Where records do not
    /// determine all of θ, a second table has the errors of what they do determine.
    ///
    /// Run i depends on the seed and i alone. Records run in parallel, each on its share of the threads: for times of one
    /// core, say --threads 1.
    Reproduce(ReproduceArguments),
    /// Score `diagnose` on trials whose truth is sealed: false alarms, detection, which effect, where, when to abstain.
    ///
    /// Records come from simulators written apart from the twins. The SHA-256 of the key file is printed before the first
    /// diagnosis; keys are read once every answer is there. What each score means: docs/withheld.md.
    Withheld(WithheldArguments),
    /// Calibrate a twin to an embedded record, in seconds, to see what it looks like.
    Demo(DemoArguments),
}

impl Command {
    /// Whether the same call goes on where this one stopped.
    pub fn is_resumed(&self) -> bool {
        match self {
            Self::Bank(_) | Self::Pretrain(_) | Self::Withheld(_) => true,
            Self::Reproduce(options) => options.out.is_some(),
            _ => false,
        }
    }

    /// Whether the ranks of a cluster share the work of this verb.
    pub fn is_shared_out(&self) -> bool {
        matches!(self, Self::Bank(_) | Self::Reproduce(_) | Self::Withheld(_))
    }

    /// The study file of the call, if it has one.
    pub fn study(&self) -> Option<&Path> {
        let subject = match self {
            Self::Twins | Self::Merge(_) | Self::Estimate(_) | Self::Demo(_) => return None,
            Self::Effects(subject) | Self::Check(subject) => subject,
            Self::Features(options) => &options.subject,
            Self::Simulate(options) => &options.subject,
            Self::Bank(options) => &options.subject,
            Self::Pretrain(options) => &options.subject,
            Self::Diagnose(options) => &options.subject,
            Self::Reproduce(options) => &options.subject,
            Self::Withheld(options) => &options.subject,
        };
        subject.study.as_deref()
    }
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

#[derive(Debug, Args)]
pub(super) struct SimulateOptions {
    #[command(flatten)]
    pub subject: Subject,
    /// Parameters: name=value, separated by commas. Unknown starts and noise levels may be left out.
    #[arg(long, value_name = "a=..,b=..")]
    pub theta: String,
    /// Effects to add: a TOML file of [[effect]] tables.
    #[arg(long, value_name = "E.toml")]
    pub effect: Option<PathBuf>,
    /// Time and inputs to simulate with; random levels as in the study unless given.
    #[arg(long, value_name = "U.csv")]
    pub input: Option<PathBuf>,
    /// Without process and measurement noise.
    #[arg(long)]
    pub noise_free: bool,
    /// Where to write the record; standard output unless given.
    #[arg(long, value_name = "R.csv")]
    pub out: Option<PathBuf>,
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

#[derive(Debug, Args)]
#[command(after_help = "A job array of four, then one bank:\n  \
        truetwin bank --twin tanks --size 1000000 --shard $I/4 --out bank-$I\n  \
        truetwin merge bank-1 bank-2 bank-3 bank-4 --out bank\n  \
        truetwin pretrain --twin tanks --bank bank --out tanks.est\n\
        On a shared file system all jobs may name one DIR, and nothing is to be merged. See docs/scaling.md.")]
pub(super) struct BankArguments {
    #[command(flatten)]
    pub subject: Subject,
    /// Simulations.
    #[arg(long, value_name = "M", value_parser = at_least_one)]
    pub size: usize,
    /// A folder for the shards: a new one, or one of this very call to go on with.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Only part i of n of the shards, for job arrays that count from 0 or from 1.
    #[arg(long, value_name = "I/N")]
    pub shard: Option<Share>,
    /// Whose features.
    #[arg(long, value_enum, default_value = "default")]
    pub preset: PresetArgument,
}

#[derive(Debug, Args)]
pub(super) struct FeaturesArguments {
    /// Records, measured or simulated.
    #[arg(value_name = "R.csv", required = true)]
    pub records: Vec<PathBuf>,
    #[command(flatten)]
    pub subject: Subject,
    /// Whose features.
    #[arg(long, value_enum, default_value = "default")]
    pub preset: PresetArgument,
    /// A new .npy, .npz or .csv file, one record a row; standard output, as CSV, unless given.
    #[arg(long, value_name = "X.npy")]
    pub out: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct MergeArguments {
    /// Folders of one call of `truetwin bank`.
    #[arg(value_name = "DIR", required = true)]
    pub from: Vec<PathBuf>,
    /// A new folder for the bank, or a file with the name of an .npz or .csv.
    #[arg(long, value_name = "OUT")]
    pub out: PathBuf,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Stopped or killed, the same call goes on where it was: EST.part keeps the bank and the training until EST is there."
)]
pub(super) struct PretrainArguments {
    #[command(flatten)]
    pub subject: Subject,
    /// Where to write the estimator.
    #[arg(long, value_name = "EST")]
    pub out: PathBuf,
    /// Simulations to train on; the preset's unless given.
    #[arg(long, value_name = "M")]
    pub bank_size: Option<usize>,
    /// A bank to train on, instead of simulating one: a folder of `truetwin bank`, or an .npz or .csv file of theta and features.
    #[arg(long, value_name = "BANK", conflicts_with = "bank_size")]
    pub bank: Option<PathBuf>,
    /// Passes over the bank; the preset's unless given.
    #[arg(long)]
    pub epochs: Option<usize>,
    /// Recipe.
    #[arg(long, value_enum, default_value = "default")]
    pub preset: PresetArgument,
    /// Seconds after which the training is kept, again and again; 0: after each block of the bank.
    #[arg(long, value_name = "SECONDS", default_value = "10", value_parser = seconds)]
    pub checkpoint: Duration,
}

#[derive(Debug, Args)]
pub(super) struct EstimateArguments {
    /// The measured record.
    #[arg(value_name = "R.csv")]
    pub record: PathBuf,
    /// The estimator, from `truetwin pretrain`.
    #[arg(long, value_name = "EST")]
    pub estimator: PathBuf,
    /// A second record of the same system to score the calibrated twin on.
    #[arg(long, value_name = "V.csv")]
    pub validation: Option<PathBuf>,
    /// Numbers of the refinement; the estimator's own unless given.
    #[arg(long, value_enum)]
    pub preset: Option<PresetArgument>,
    /// Refine and tune even where the gate would keep the network's estimate.
    #[arg(long)]
    pub always_refine: bool,
    /// A new folder for estimate.json, overlay.svg, trajectories.csv and, after a refit, the cloud of simulations (cloud.npz).
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct DiagnoseArguments {
    /// Measured records of one system; they share θ, but for unknown starts.
    #[arg(value_name = "R.csv", required = true)]
    pub records: Vec<PathBuf>,
    #[command(flatten)]
    pub subject: Subject,
    /// An estimator of the same twin, whose first estimate is a start of the fit.
    #[arg(long, value_name = "EST")]
    pub estimator: Option<PathBuf>,
    /// A record that no fit sees: sharper test and ranking, and the share of the gap that closes.
    #[arg(long, value_name = "V.csv")]
    pub validation: Option<PathBuf>,
    /// Effects that are not to be named.
    #[arg(long, value_name = "ID[@TARGET],..", value_delimiter = ',')]
    pub without: Vec<String>,
    /// A new folder for report.json, report.html and next-input.csv.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Where true parameters come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum ScenarioArgument {
    /// Drawn from the prior, where the network was trained
    #[value(name = "0")]
    Prior,
    /// The paper's first point outside the prior, that of its table (OOD 1)
    #[value(name = "1")]
    First,
    /// The paper's second point outside the prior, that of its figures (OOD 2)
    #[value(name = "2")]
    Second,
    /// Drawn from the physical bounds
    #[value(name = "uniform", alias = "3")]
    Uniform,
}

impl From<ScenarioArgument> for Scenario {
    fn from(argument: ScenarioArgument) -> Self {
        match argument {
            ScenarioArgument::Prior => Self::InDistribution,
            ScenarioArgument::First => Self::First,
            ScenarioArgument::Second => Self::Second,
            ScenarioArgument::Uniform => Self::Uniform,
        }
    }
}

#[derive(Debug, Args)]
#[command(after_help = "The paper's table and figures:\n  \
        truetwin reproduce --twin van-der-pol --preset paper --out vdp-1\n  \
        truetwin reproduce --twin tanks --preset paper --out tanks-1\n  \
        truetwin reproduce --twin tanks --preset paper --scenario 2 --out tanks-2\n\
        A twin of your own, over all of its bounds:\n  \
        truetwin reproduce --study S.toml --scenario uniform --runs 200 --out study\n\n\
        DIR holds reproduce.json (as --json), table.txt, trajectories.svg (as in the paper: the truth and the mean\n\
        predictions; scenarios 1 and 2), first-record.svg, and what it takes to go on: manifest.json, estimator.est,\n\
        runs/0000.json and so on. Interrupted, the same call goes on where it stopped; another call is refused.")]
pub(super) struct ReproduceArguments {
    #[command(flatten)]
    pub subject: Subject,
    /// Where the true parameters of the records come from.
    #[arg(long, value_enum, default_value = "1")]
    pub scenario: ScenarioArgument,
    /// Simulated records; the paper has 100.
    #[arg(long, default_value_t = 100, value_parser = at_least_one)]
    pub runs: usize,
    /// Recipe.
    #[arg(long, value_enum, default_value = "default")]
    pub preset: PresetArgument,
    /// An estimator to score, instead of pretraining one.
    #[arg(long, value_name = "EST", conflicts_with_all = ["preset", "bank_size", "epochs"])]
    pub estimator: Option<PathBuf>,
    /// Simulations to train on; the preset's unless given.
    #[arg(long, value_name = "M")]
    pub bank_size: Option<usize>,
    /// Passes over the bank; the preset's unless given.
    #[arg(long)]
    pub epochs: Option<usize>,
    /// A folder for the results: a new one, or one of this very call to go on with.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Only part i of n of the records, for job arrays; once all parts are done, the same call without it ends the work.
    #[arg(long, value_name = "I/N", requires = "out")]
    pub shard: Option<Share>,
}

#[derive(Debug, Args)]
#[command(
    after_help = "DIR holds scorecard.json (as --json), scorecard.html, and what it takes to go on: manifest.json, seal.txt,\n\
        keys.json, records, answers. Interrupted, the same call goes on where it stopped; another call is refused."
)]
pub(super) struct WithheldArguments {
    #[command(flatten)]
    pub subject: Subject,
    /// Records.
    #[arg(long, value_parser = at_least_one)]
    pub trials: usize,
    /// A folder for the trials: a new one, or one of this very call to go on with.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Kinds of truth; all unless given.
    #[arg(long, value_name = "KIND,..", value_delimiter = ',', value_parser = kind)]
    pub kinds: Option<Vec<Kind>>,
    /// Take the true effects out of the library: where there is one, the right answer is to abstain.
    #[arg(long)]
    pub without: bool,
    /// Give each diagnosis a second record.
    #[arg(long)]
    pub validation: bool,
    /// End each diagnosis with its verdict: false alarms and detection, in a third of the time.
    #[arg(long)]
    pub detection_only: bool,
    /// Only part i of n of the diagnoses, for job arrays; once all parts are done, the same call without it ends the work.
    #[arg(long, value_name = "I/N")]
    pub shard: Option<Share>,
}

/// A kind of truth.
fn kind(text: &str) -> Result<Kind, String> {
    let known = || Kind::ALL.map(Kind::id).join(", ");
    Kind::named(text).ok_or_else(|| format!("kinds are {}", known()))
}

/// A number of runs.
fn at_least_one(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("at least 1 is needed".into()),
        Ok(number) => Ok(number),
        Err(error) => Err(format!("{error}")),
    }
}

fn seconds(text: &str) -> Result<Duration, String> {
    let number: f64 = text.parse().map_err(|error| format!("{error}"))?;
    Duration::try_from_secs_f64(number).map_err(|error| error.to_string())
}

#[derive(Debug, Args)]
pub(super) struct DemoArguments {
    /// A twin by name; the first one that has a demo unless given.
    #[arg(long)]
    pub twin: Option<String>,
    /// A new folder for the result, the picture and the record.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}
