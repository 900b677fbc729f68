//! `features`: records, compressed.

use super::args::FeaturesArguments;
use super::{Context, Failure, output};
use crate::bank::file;
use crate::twin::read_record;
use ndarray::Array2;
use serde_json::json;
use std::process::ExitCode;

pub(super) fn run(context: &Context<'_>, options: &FeaturesArguments) -> Result<ExitCode, Failure> {
    if let Some(out) = &options.out {
        output::check_new(out)?;
    }
    let study = context.study(&options.subject)?;
    let recipe = &study.preset(options.preset.into()).features;
    let map = study.features(recipe.as_ref())?;
    let mut all = Vec::new();
    for path in &options.records {
        let at = |failure: Failure| failure.within(path);
        let record = read_record(path)?;
        study
            .check_record(&record)
            .map_err(|error| at(error.into()))?;
        let features = map.extract(record.drive(), record.outputs());
        all.extend(features.map_err(|error| at(error.into()))?);
    }
    let features = Array2::from_shape_vec((options.records.len(), map.dim()), all)
        .map_err(Failure::internal)?;
    if let Some(out) = &options.out {
        file::write_features(out, &features)?;
    }
    match (context.json, &options.out) {
        (true, _) => {
            let rows: Vec<Vec<f64>> = features.rows().into_iter().map(|r| r.to_vec()).collect();
            output::print_json(&json!({
                "schema": "truetwin.features/1", "twin": study.name(), "features": rows,
            }))?;
        }
        (false, None) => {
            let text = file::features_csv_text(&features).map_err(Failure::internal)?;
            output::print(&text)?;
        }
        (false, Some(out)) => {
            let (rows, n) = features.dim();
            output::print(&format!("{}: {rows} × {n} features", out.display()))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}
