//! `diagnose`: what the twin lacks.

use super::args::DiagnoseArguments;
use super::{Context, Failure, output};
use crate::diagnose::{DiagnoseSettings, GivenRecord, diagnose};
use crate::report::{NEXT_INPUT, gap_html, gap_json, gap_text};
use crate::study::Study;
use crate::twin::{Record, drive_csv_text, read_record};
use crate::two_stage::Estimator;
use std::path::Path;
use std::process::ExitCode;

pub(super) fn run(context: &Context<'_>, options: &DiagnoseArguments) -> Result<ExitCode, Failure> {
    if let Some(out) = &options.out {
        output::check_new(out)?;
    }
    let study = context.study(&options.subject)?;
    let records: Vec<Record> = (options.records.iter())
        .map(|path| read_record(path))
        .collect::<Result<_, _>>()?;
    let validation = options.validation.as_deref().map(read_record).transpose()?;
    let initial = match &options.estimator {
        Some(path) => Some(first_estimate(context, &study, path, &records[0])?),
        None => None,
    };
    let settings = DiagnoseSettings {
        seed: context.seed,
        without: options.without.clone(),
        initial,
        ..DiagnoseSettings::default()
    };
    let found = diagnose(
        &study,
        &records,
        validation.as_ref(),
        &settings,
        context.progress,
    )
    .map_err(|error| {
        let path = match error.record() {
            Some(GivenRecord::Validation) => options.validation.as_ref(),
            Some(GivenRecord::Measured(index)) => options.records.get(index),
            None => None,
        };
        let failure = Failure::from(error);
        match path {
            Some(path) => failure.within(path),
            None => failure,
        }
    })?;
    let json = gap_json(&found);
    if let Some(out) = &options.out {
        let folder = output::NewFolder::new(out)?;
        let text = serde_json::to_string_pretty(&json).map_err(Failure::internal)?;
        folder.write("report.json", &text)?;
        folder.write("report.html", &gap_html(&study, &found))?;
        if let Some(next) = &found.which.next_input {
            folder.write(NEXT_INPUT, &drive_csv_text(&next.drive))?;
        }
        folder.finish()?;
    }
    if context.json {
        output::print_json(&json)?;
    } else {
        output::print(&gap_text(&found))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// What a pretrained network reads off the first record.
fn first_estimate(
    context: &Context<'_>,
    study: &Study,
    path: &Path,
    record: &Record,
) -> Result<Vec<f64>, Failure> {
    let estimator = Estimator::load(path, context.studies)?;
    let names = |study: &Study| -> Vec<String> {
        let space = study.twin().parameters();
        space.names().into_iter().map(Into::into).collect()
    };
    let (theirs, ours) = (names(estimator.study()), names(study));
    if theirs != ours {
        return Err(Failure::user(format!(
            "{}: the estimator is of {}, the call of {}; pretrain one for this twin and study",
            path.display(),
            theirs.join(", "),
            ours.join(", ")
        )));
    }
    let checked = estimator.study().check_record(record);
    checked.map_err(Failure::from)?;
    let features = estimator.observe(record)?;
    Ok(estimator.predict_one(&features)?)
}
