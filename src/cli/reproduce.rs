//! `reproduce`: the paper's table and figures, on any twin.

use super::args::ReproduceArguments;
use super::{Context, Failure, output};
use crate::experiment::{
    Benchmark, FreeRuns, Manifest, MeanRuns, MonteCarlo, Origin, Run, Store, score,
};
use crate::report::{first_run_svg, mean_runs_svg, reproduce_json, reproduce_text};
use crate::study::Study;
use crate::two_stage::{Estimator, PretrainOptions, pretrain};
use std::path::Path;
use std::process::ExitCode;

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
    let store = match &options.out {
        Some(out) => {
            let origin = match &given {
                Some((path, _)) => Origin::File(path),
                None => Origin::Trained(&training),
            };
            Some(Store::open(out, &Manifest::new(study, &plan, origin)?)?)
        }
        None => None,
    };
    let estimator = match (given, &store) {
        (Some((_, estimator)), _) => estimator,
        (None, None) => pretrain(study, &training, context.progress)?.0,
        (None, Some(store)) => kept(context, study, &training, store)?,
    };
    let runs = plan.run(&estimator, store.as_ref(), context.progress)?;
    let scores = score(study, &plan, &runs);
    let json = reproduce_json(study, &plan, estimator.preset(), &scores);
    let text = reproduce_text(study, &plan, estimator.preset(), &scores);
    if let Some(store) = &store {
        draw(store, study, &plan, &runs)?;
        store.write("table.txt", &text)?;
        // Last: where it is, everything is.
        store.write("reproduce.json", &format!("{json:#}\n"))?;
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
    store: &Store,
) -> Result<Estimator, Failure> {
    let path = store.estimator();
    if !path.exists() {
        (pretrain(study, training, context.progress)?.0).save(&path)?;
    }
    Ok(Estimator::load(&path, context.studies)?)
}

/// `trajectories.svg`, where all records have the same truth, and `first-record.svg`.
fn draw(store: &Store, study: &Study, plan: &MonteCarlo, runs: &[Run]) -> Result<(), Failure> {
    if let Some(means) = MeanRuns::of(study, plan, runs)?
        && let Some(svg) = mean_runs_svg(study, &means)
    {
        store.write("trajectories.svg", &svg)?;
    }
    if let Some(first) = runs.first() {
        let free = FreeRuns::of(study, plan, first)?;
        store.write("first-record.svg", &first_run_svg(study, &free))?;
    }
    Ok(())
}
