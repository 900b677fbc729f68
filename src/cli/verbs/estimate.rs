//! `estimate`: estimates the parameters behind a record.

use crate::cli::args::{FileColumns, PresetArgument};
use crate::cli::context::{Context, Verb};
use crate::cli::failure::Failure;
use crate::cli::posterior::{self, PosteriorDraws};
use crate::cli::provenance::Provenance;
use crate::cli::{output, records};
use crate::estimator::bank::file;
use crate::estimator::{self, EstimateOptions, Estimator};
use crate::record::Record;
use crate::report::{Report, overlay_svg, trajectories_csv};
use crate::study::Study;
use clap::Args;
use std::path::PathBuf;
use std::process::ExitCode;

/// Estimate the parameters behind a measured record.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
        truetwin estimate R.csv --estimator tanks.est --validation V.csv --out result\n\
        If the calibrated twin does not explain the record, next: truetwin diagnose R.csv")]
pub(in crate::cli) struct Estimate {
    /// Measured record.
    #[arg(value_name = "R.csv")]
    record: PathBuf,
    /// Estimator from `truetwin pretrain`.
    #[arg(long, value_name = "EST")]
    estimator: PathBuf,
    #[command(flatten)]
    columns: FileColumns,
    /// Second record of the same system, to score the calibrated twin.
    #[arg(long, value_name = "V.csv")]
    validation: Option<PathBuf>,
    /// Settings of the refinement [default: the estimator's own].
    #[arg(long, value_enum)]
    preset: Option<PresetArgument>,
    /// Refine though the study trusts its prior and the record is consistent with the network's estimate.
    #[arg(long)]
    always_refine: bool,
    #[command(flatten)]
    draws: PosteriorDraws,
    /// New folder for estimate.json, the page report.html, overlay.svg, trajectories.csv and, after a refit, the cloud of simulations (cloud.npz).
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Verb for Estimate {
    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        let folder = self.out.as_deref().map(output::NewFolder::new);
        let folder = folder.transpose()?;
        let estimator = Estimator::load(&self.estimator, context.projects)?;
        let paths = std::slice::from_ref(&self.record);
        let reader = self.columns.reader(estimator.study());
        let (mut records, validation) = records::read(reader, paths, self.validation.as_deref())?;
        let record = records.remove(0);
        let settings = EstimateOptions {
            seed: context.seed,
            preset: self.preset.map(Into::into),
            always_refine: self.always_refine,
            validation,
            draws: self.draws.count()?,
        };
        if let Some((validation, path)) = settings.validation.as_ref().zip(self.validation.as_ref())
        {
            let checked = estimator.study().check_record(validation);
            checked.map_err(|error| Failure::from(error).within(path))?;
        }
        let estimate = (estimator.estimate(&record, &settings, context.progress))
            .map_err(|error| Failure::from(error).within(&self.record))?;
        let files = [
            ("record", self.record.as_path()),
            ("estimator", self.estimator.as_path()),
        ];
        let validation = self.validation.as_deref().map(|path| ("validation", path));
        let provenance = Provenance::new(context, None, files.into_iter().chain(validation));
        if let Some(folder) = folder {
            write_results(&folder, estimator.study(), &record, &estimate, &provenance)?;
            folder.finish()?;
        }
        show(context, estimator.study(), &estimate, &provenance)?;
        Ok(ExitCode::SUCCESS)
    }
}

/// Prints an estimate.
pub(super) fn show(
    context: &Context<'_>,
    study: &Study,
    estimate: &estimator::Estimate,
    provenance: &Provenance,
) -> Result<(), Failure> {
    if context.json {
        output::print_json(&provenance.on(estimate.json(study)))
    } else {
        output::print(&provenance.below(&estimate.text(study)))
    }
}

/// Writes `estimate.json`, `report.html`, `overlay.svg`, `trajectories.csv`, `cloud.npz`.
pub(super) fn write_results(
    folder: &output::NewFolder,
    study: &Study,
    record: &Record,
    estimate: &estimator::Estimate,
    provenance: &Provenance,
) -> Result<(), Failure> {
    let json = serde_json::to_string_pretty(&provenance.on(estimate.json(study)));
    folder.write("estimate.json", &json.map_err(Failure::internal)?)?;
    if let Some(cloud) = &estimate.cloud {
        let names: Vec<&str> = estimate.names.iter().map(String::as_str).collect();
        file::write(&folder.file("cloud.npz"), cloud, &names)?;
    }
    if let Some(draws) = &estimate.posterior {
        posterior::write(folder, study, draws)?;
    }
    let page = provenance.in_page(&estimate.html(study, record));
    folder.write("report.html", &page)?;
    let before = estimate.tracking_initial.as_ref().map(|t| &t.outputs);
    // A free run that diverged cannot be drawn; the text reports it.
    let Some(after) = estimate.tracking.as_ref().map(|t| &t.outputs) else {
        return Ok(());
    };
    folder.write("overlay.svg", &overlay_svg(study, record, before, after))?;
    folder.write("trajectories.csv", &trajectories_csv(record, before, after))
}
