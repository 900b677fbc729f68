//! `reproduce`: the paper's table and figures, on any twin.

use super::args::ReproduceArguments;
use super::{Context, Failure, output};
use crate::experiment::{Benchmark, FreeRuns, MeanRuns, MonteCarlo, Origin, Run, score};
use crate::report::{first_run_svg, mean_runs_svg, reproduce_json, reproduce_text};
use crate::study::Study;
use crate::two_stage::{Estimator, PretrainError, PretrainOptions, Pretraining, pretrain};
use crate::work::{WorkError, WorkFolder};
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

/// How often a job looks whether another one has trained the estimator.
const LOOK: Duration = Duration::from_millis(200);

pub(super) fn run(
    context: &Context<'_>,
    options: &ReproduceArguments,
) -> Result<ExitCode, Failure> {
    let study = context.study(&options.subject)?;
    let given = match &options.estimator {
        Some(path) => Some((path, load(context, path, &study)?)),
        None => None,
    };
    // An estimator carries the setting that it was made for.
    let study = &(given.as_ref()).map_or(study, |(_, estimator)| estimator.study().clone());
    let plan = MonteCarlo {
        benchmark: Benchmark::of(study),
        scenario: options.scenario.into(),
        runs: options.runs,
        seed: context.seed,
    };
    plan.check(study)?;
    let training = PretrainOptions {
        preset: options.preset.into(),
        bank_size: options.bank_size,
        epochs: options.epochs,
        seed: context.seed,
    };
    if options.out.is_none() && !context.team.is_alone() {
        return Err(Failure::user("ranks meet in a folder; name one with --out"));
    }
    let share = context.share(options.shard)?;
    let folder = match &options.out {
        Some(out) => {
            let origin = match &given {
                Some((path, _)) => Origin::File(path),
                None => Origin::Trained(&training),
            };
            Some(plan.folder(out, study, origin)?)
        }
        None => None,
    };
    let estimator = match (given, &folder) {
        (Some((_, estimator)), _) => estimator,
        (None, None) => pretrain(study, &training, context.progress)?.0,
        (None, Some(folder)) => kept(context, study, &training, folder)?,
    };
    if let (Some(out), Some(folder)) = (&options.out, &folder) {
        let there = plan
            .run_share(&estimator, Some(folder), share, context.progress)?
            .len();
        if options.shard.is_some() && there < options.runs {
            return output::print_share(context, out, "records", there, options.runs);
        }
        context.team.wait();
        if !context.team.leads() {
            return Ok(ExitCode::SUCCESS);
        }
    }
    let runs = plan.run(&estimator, folder.as_ref(), context.progress)?;
    let scores = score(study, &plan, &runs);
    let json = reproduce_json(study, &plan, estimator.preset(), &scores);
    let text = reproduce_text(study, &plan, estimator.preset(), &scores);
    if let Some(folder) = &folder {
        draw(folder, study, &plan, &runs)?;
        folder.write("table.txt", &text)?;
        // Last: where it is, everything is.
        folder.write("reproduce.json", &format!("{json:#}\n"))?;
    }
    match context.json {
        true => output::print_json(&json)?,
        false => output::print(&text)?,
    }
    Ok(ExitCode::SUCCESS)
}

/// The estimator of a file, if it is one of this twin.
fn load(context: &Context<'_>, path: &Path, study: &Study) -> Result<Estimator, Failure> {
    let estimator = Estimator::load(path, context.studies)?;
    let (made_for, asked) = (estimator.study().name(), study.name());
    if made_for != asked {
        return Err(Failure::user(format!(
            "{}: made for twin {made_for}, --twin says {asked}; name the same twin",
            path.display()
        )));
    }
    Ok(estimator)
}

/// The folder's estimator: trained once, then read.
fn kept(
    context: &Context<'_>,
    study: &Study,
    training: &PretrainOptions,
    folder: &WorkFolder,
) -> Result<Estimator, Failure> {
    let path = folder.file("estimator.est");
    while context.team.leads() && !path.exists() {
        match Pretraining::new(study, *training).write(&path, context.progress) {
            // Another job trains the same.
            Err(PretrainError::Work(WorkError::Busy { .. })) => {
                context.progress.checkpoint().map_err(Failure::internal)?;
                std::thread::sleep(LOOK);
            }
            // Another job was faster.
            Err(_) if path.exists() => {}
            trained => drop(trained?),
        }
    }
    context.team.wait();
    Ok(Estimator::load(&path, context.studies)?)
}

/// `trajectories.svg`, where all records have the same truth, and `first-record.svg`.
fn draw(
    folder: &WorkFolder,
    study: &Study,
    plan: &MonteCarlo,
    runs: &[Run],
) -> Result<(), Failure> {
    if let Some(means) = MeanRuns::of(study, plan, runs)?
        && let Some(svg) = mean_runs_svg(study, &means)
    {
        folder.write("trajectories.svg", &svg)?;
    }
    if let Some(first) = runs.first() {
        let free = FreeRuns::of(study, plan, first)?;
        folder.write("first-record.svg", &first_run_svg(study, &free))?;
    }
    Ok(())
}
