//! `estimate`: the parameters behind a record.

use super::args::EstimateArguments;
use super::{Context, Failure, output};
use crate::bank::file;
use crate::report::{estimate_json, estimate_text, overlay_svg, trajectories_csv};
use crate::study::Study;
use crate::twin::{Record, read_record};
use crate::two_stage::{Estimate, EstimateOptions, Estimator};
use std::process::ExitCode;

pub(super) fn run(context: &Context<'_>, options: &EstimateArguments) -> Result<ExitCode, Failure> {
    if let Some(out) = &options.out {
        output::check_new(out)?;
    }
    let estimator = Estimator::load(&options.estimator, context.studies)?;
    let record = read_record(&options.record)?;
    let settings = EstimateOptions {
        seed: context.seed,
        preset: options.preset.map(Into::into),
        always_refine: options.always_refine,
        validation: options.validation.as_deref().map(read_record).transpose()?,
    };
    if let Some((validation, path)) = settings
        .validation
        .as_ref()
        .zip(options.validation.as_ref())
    {
        let checked = estimator.study().check_record(validation);
        checked.map_err(|error| Failure::from(error).within(path))?;
    }
    let estimate = (estimator.estimate(&record, &settings, context.progress))
        .map_err(|error| Failure::from(error).within(&options.record))?;
    if let Some(out) = &options.out {
        let folder = output::NewFolder::new(out)?;
        write_results(&folder, estimator.study(), &record, &estimate)?;
        folder.finish()?;
    }
    show(context, estimator.study(), &estimate)?;
    Ok(ExitCode::SUCCESS)
}

/// Prints an estimate.
pub(super) fn show(
    context: &Context<'_>,
    study: &Study,
    estimate: &Estimate,
) -> Result<(), Failure> {
    if context.json {
        output::print_json(&estimate_json(study, estimate))
    } else {
        output::print(&estimate_text(study, estimate))
    }
}

/// `estimate.json`, `overlay.svg`, `trajectories.csv`, `cloud.npz`.
pub(super) fn write_results(
    folder: &output::NewFolder,
    study: &Study,
    record: &Record,
    estimate: &Estimate,
) -> Result<(), Failure> {
    let json = serde_json::to_string_pretty(&estimate_json(study, estimate));
    folder.write("estimate.json", &json.map_err(Failure::internal)?)?;
    if let Some(cloud) = &estimate.cloud {
        let names: Vec<&str> = estimate.names.iter().map(String::as_str).collect();
        file::write(&folder.file("cloud.npz"), cloud, &names)?;
    }
    let before = estimate.tracking_initial.as_ref().map(|t| &t.outputs);
    // A free run that diverged leaves nothing to draw; the text says so.
    let Some(after) = estimate.tracking.as_ref().map(|t| &t.outputs) else {
        return Ok(());
    };
    folder.write("overlay.svg", &overlay_svg(study, record, before, after))?;
    folder.write("trajectories.csv", &trajectories_csv(record, before, after))
}
