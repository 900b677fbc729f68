//! Distance of the estimator from the information bound of a record, and attempts that did not shorten it. Studies of minutes, run by
//! name; `RUNS=100` sets the number of records.
//!
//! ```text
//! cargo test --release --lib limits -- --ignored --nocapture
//! ```

mod adversarial;
mod cloud_free;
mod likelihood;
mod low_snr;

use crate::estimator::{Estimate, EstimateOptions, Estimator, PretrainOptions, pretrain};
use crate::evaluate::paper::{Benchmark, MonteCarlo, Scenario, reference_studies};
use crate::progress::Progress;
use crate::record::Record;
use crate::study::{Study, StudyFile};
use std::path::Path;

/// Seed of records; another one chose the recipe.
const SEED: u64 = 101;

/// Records of a study.
fn runs() -> usize {
    (std::env::var("RUNS").ok())
        .and_then(|text| text.parse().ok())
        .unwrap_or(20)
}

/// A reference study in the setting of a file.
fn study(twin: &str, tables: &str) -> Study {
    let studies = reference_studies().unwrap();
    let registered = studies.iter().find(|s| s.name() == twin).unwrap();
    let text = format!("twin = \"{twin}\"\n{tables}");
    let file = StudyFile::parse(&text, Path::new("study.toml")).unwrap();
    registered.configure(&file).unwrap()
}

fn pretrained(study: &Study) -> Estimator {
    let options = PretrainOptions {
        seed: 1,
        ..PretrainOptions::default()
    };
    pretrain(study, &options, &Progress::silent()).unwrap().0
}

fn records(study: &Study, scenario: Scenario, runs: usize) -> Vec<(Vec<f64>, Record)> {
    let plan = MonteCarlo {
        benchmark: Benchmark::of(study),
        scenario,
        runs,
        seed: SEED,
    };
    (0..runs)
        .map(|run| plan.record(study, run).unwrap())
        .collect()
}

/// Refined and tuned, whatever the gate says.
fn refined(estimator: &Estimator, record: &Record, run: usize) -> Estimate {
    let options = EstimateOptions {
        seed: run as u64,
        always_refine: true,
        ..EstimateOptions::default()
    };
    estimator
        .estimate(record, &options, &Progress::silent())
        .unwrap()
}

/// Squared error, averaged over parameters.
fn square(estimate: &[f64], truth: &[f64]) -> f64 {
    let squares = estimate.iter().zip(truth).map(|(a, b)| (a - b).powi(2));
    squares.sum::<f64>() / truth.len() as f64
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.collect();
    values.iter().sum::<f64>() / values.len() as f64
}
