//! `reproduce`: the paper's table and figures, on any twin.

use crate::cli::prelude::*;
use crate::estimator::{
    Estimator, EstimatorError, PretrainOptions, Pretraining, Project, pretrain,
};
use crate::evaluate::paper::{
    AnswerRuns, Benchmark, BenchmarkRun, MeanRuns, MonteCarlo, Origin, Scenario, score,
};
use crate::network::NetworkError;
use crate::report::{coverage_svg, first_run_svg, mean_runs_svg, reproduce_json, reproduce_text};
use crate::storage::StorageError;
use crate::storage::work::{Share, WorkFolder};
use clap::{Args, ValueEnum};
use std::time::Duration;

/// Interval between checks whether another job has trained the estimator.
const LOOK: Duration = Duration::from_millis(200);

/// Source of the true parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ScenarioArgument {
    /// Drawn from the prior of the training
    #[value(name = "0")]
    Prior,
    /// The paper's first point outside the prior, that of its table (OOD 1)
    #[value(name = "1")]
    First,
    /// The paper's second point outside the prior, that of its figures (OOD 2)
    #[value(name = "2")]
    Second,
    /// Drawn from the physical bounds (also 3)
    #[value(name = "uniform", alias = "3")]
    Uniform,
    /// Twelve fixed points, six in the prior and six outside it: errors and coverage at each (also 4)
    #[value(name = "grid", alias = "4")]
    Grid,
}

impl From<ScenarioArgument> for Scenario {
    fn from(argument: ScenarioArgument) -> Self {
        match argument {
            ScenarioArgument::Prior => Self::InDistribution,
            ScenarioArgument::First => Self::First,
            ScenarioArgument::Second => Self::Second,
            ScenarioArgument::Uniform => Self::Uniform,
            ScenarioArgument::Grid => Self::Grid,
        }
    }
}

/// Score every method on simulated records: the paper's table and figures.
///
/// Methods: the pretrained network (TS-pre), Gauss–Newton (GN), tuned heads (TS-fine, the answer of `estimate`), the choice of the
/// gate between network and tuned heads (final, the answer of `estimate` if the study says `[prior] trust = true`), and as baselines the prediction-error method (PEM) and the dual Kalman filter (dual-EKF), each from a good
/// start, from TS-pre, and from a bad start. The paper's figures stand beside ours. If records do not determine all of θ,
/// a second table has the errors of the combinations that they determine.
///
/// Run i depends only on the seed and i. Records run in parallel, each on its share of the threads: for times of one core, use --threads 1.
#[derive(Debug, Args)]
#[command(after_help = "The paper's table and figures:\n  \
        truetwin reproduce --twin van-der-pol --preset paper --out vdp-1\n  \
        truetwin reproduce --twin tanks --preset paper --out tanks-1\n  \
        truetwin reproduce --twin tanks --preset paper --scenario 2 --out tanks-2\n\
        A twin of your own, over all of its bounds:\n  \
        truetwin reproduce --study S.toml --scenario uniform --runs 200 --out study\n\n\
        DIR holds reproduce.json (as --json), table.txt, trajectories.svg (as in the paper: the truth and the mean\n\
        predictions; scenarios 1 and 2), coverage.svg (scenario grid), first-record.svg, and the state of the work: manifest.json, estimator.est,\n\
        runs/NNNN.json. Interrupted, the same command resumes it; a different command is refused.")]
pub(in crate::cli) struct Reproduce {
    #[command(flatten)]
    subject: Subject,
    /// Source of the true parameters.
    #[arg(long, value_enum, default_value = "1")]
    scenario: ScenarioArgument,
    /// Number of simulated records; the paper has 100.
    #[arg(long, default_value_t = 100, value_parser = at_least_one)]
    runs: usize,
    /// Recipe of features, network and refinement.
    #[arg(long, value_enum, default_value = "default")]
    preset: PresetArgument,
    /// Existing estimator to score, in the setting that it was trained in; a study beside it must be that.
    #[arg(long, value_name = "EST", conflicts_with_all = ["preset", "bank_size", "epochs"])]
    estimator: Option<PathBuf>,
    /// Number of simulations [default: the preset's].
    #[arg(long, value_name = "M")]
    bank_size: Option<usize>,
    /// Passes over the bank [default: the preset's].
    #[arg(long)]
    epochs: Option<usize>,
    /// Output folder; rerunning the same command resumes it.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Share i of n of the records, for job arrays; when all shares are done, rerun without --shard to merge.
    #[arg(long, value_name = "I/N", requires = "out")]
    shard: Option<Share>,
}

impl Verb for Reproduce {
    fn kept(&self) -> Option<PathBuf> {
        self.out.clone()
    }

    fn is_shared_out(&self) -> bool {
        true
    }

    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        let project = context.project(&self.subject)?;
        let given = (self.estimator.as_ref())
            .map(|path| context.estimator(path, Some(project.study()), &self.subject))
            .transpose()?;
        // An estimator carries the setting that it was made for.
        let study = (given.as_ref()).map_or(project.study(), Estimator::study);
        let study = &study.clone();
        let plan = MonteCarlo {
            benchmark: Benchmark::of(study),
            scenario: self.scenario.into(),
            runs: self.runs,
            seed: context.seed,
        };
        plan.check(study)?;
        let training = PretrainOptions {
            preset: self.preset.into(),
            bank_size: self.bank_size,
            epochs: self.epochs,
            seed: context.seed,
        };
        if given.is_none() {
            // Before anything is written.
            Pretraining::new(&project, training).check()?;
        }
        if self.out.is_none() && !context.ranks.is_alone() {
            return Err(Failure::user("--out is required under mpirun"));
        }
        let share = context.share(self.shard)?;
        let origin = match &self.estimator {
            Some(path) => Origin::File(path),
            None => Origin::Trained(project.recipe(training.preset), &training),
        };
        let folder = (self.out.as_ref())
            .map(|out| plan.folder(out, study, origin))
            .transpose()?;
        let estimator = match (given, &folder) {
            (Some(estimator), _) => estimator,
            (None, None) => pretrain(&project, &training, context.progress)?.0,
            (None, Some(folder)) => kept(context, &project, &training, folder)?,
        };
        if let Some(folder) = &folder {
            let runs = plan.run_share(&estimator, Some(folder), share, context.progress)?;
            if self.shard.is_some() && runs.len() < self.runs {
                return context.print_share(folder.path(), "records", runs.len(), self.runs);
            }
            context.ranks.wait();
            if !context.ranks.is_root() {
                return Ok(ExitCode::SUCCESS);
            }
        }
        let runs = plan.run_in(&estimator, folder.as_ref(), context.progress)?;
        let scores = score(study, &plan, &runs);
        let provenance = Provenance::new(context).files("estimator", &self.estimator);
        let json = provenance.on(reproduce_json(study, &plan, estimator.preset(), &scores));
        let text = reproduce_text(study, &plan, estimator.preset(), &scores);
        let write = || {
            let Some(folder) = &folder else { return Ok(()) };
            let stage = context.progress.stage("figures", 1);
            draw(folder, study, &plan, &runs)?;
            if let Some(svg) = coverage_svg(study, &scores.points) {
                folder.write("coverage.svg", &svg)?;
            }
            stage.finish();
            folder.write("table.txt", &text)?;
            // Written last: it marks the folder as complete.
            Ok(folder.write("reproduce.json", &format!("{json:#}\n"))?)
        };
        provenance.deliver(context, &json, write, || text.clone())
    }
}

/// Loads the folder's estimator; trains it first if needed.
fn kept(
    context: &Context<'_>,
    project: &Project,
    training: &PretrainOptions,
    folder: &WorkFolder,
) -> Result<Estimator, Failure> {
    let path = folder.file("estimator.est");
    while context.ranks.is_root() && !path.exists() {
        match Pretraining::new(project, *training).write(&path, context.progress) {
            // Another job is training it.
            Err(EstimatorError::Work(StorageError::Busy(_))) => {
                context.progress.checkpoint().map_err(Failure::internal)?;
                std::thread::sleep(LOOK);
            }
            // Another job was faster.
            Err(_) if path.exists() => {}
            Err(error) => {
                // It would only stand in the way of the next call. One that is stopped may have others beside it.
                if !is_stop(&error) && !Pretraining::work_folder(&path).exists() {
                    MonteCarlo::remove_bare(folder);
                }
                return Err(error.into());
            }
            Ok(_) => {}
        }
    }
    context.ranks.wait();
    let estimator = Estimator::load(&path, context.projects).map_err(|error| match error {
        error @ EstimatorError::Work(_) => Failure::from(error),
        // It is a piece of this folder, which nobody pretrains elsewhere.
        _ => StorageError::Piece {
            path: path.clone(),
            reason: "it is not the estimator that was written".into(),
        }
        .into(),
    })?;
    folder.seal("estimator.est", "reproduce")?;
    Ok(estimator)
}

/// Returns whether the caller has stopped the training.
fn is_stop(error: &EstimatorError) -> bool {
    matches!(
        error,
        EstimatorError::Cancelled(_) | EstimatorError::Network(NetworkError::Cancelled(_))
    )
}

/// Draws `first-record.svg` and, if all records share one truth, `trajectories.svg`.
fn draw(
    folder: &WorkFolder,
    study: &Study,
    plan: &MonteCarlo,
    runs: &[BenchmarkRun],
) -> Result<(), Failure> {
    if let Some(means) = MeanRuns::of(study, plan, runs)?
        && let Some(svg) = mean_runs_svg(study, &means)
    {
        folder.write("trajectories.svg", &svg)?;
    }
    if let Some(first) = runs.first() {
        let free = AnswerRuns::of(study, plan, first)?;
        folder.write("first-record.svg", &first_run_svg(study, &free))?;
    }
    Ok(())
}
