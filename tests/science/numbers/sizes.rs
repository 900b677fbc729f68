//! Long records, many parameters, many outputs: every step works, and its numbers are finite.

use super::chain::{Chain, Units};
use std::time::Instant;
use truetwin::diagnose::{DiagnoseSettings, diagnose};
use truetwin::estimator::{PretrainOptions, Project, pretrain};
use truetwin::feature::Arx;
use truetwin::progress::Progress;

/// From bank to estimate.
fn estimated(chain: Chain, project: impl Into<Project>, samples: usize, bank: usize) {
    let options = PretrainOptions {
        bank_size: Some(bank),
        epochs: Some(20),
        seed: 1,
        ..PretrainOptions::default()
    };
    let silent = Progress::silent();
    let (estimator, history) = pretrain(project, &options, &silent).unwrap();
    assert!(history.training.iter().all(|loss| loss.is_finite()));
    let record = chain.record(1.1, samples, 3);
    let estimate = (estimator.estimate(&record)).unwrap();
    for j in 0..chain.tanks {
        let truth = 1.1 * chain.rate(j);
        let (theta, error) = (estimate.theta[j], estimate.std_error[j]);
        assert!(error.is_finite() && error > 0.0, "k{j}: ± {error}");
        assert!(
            (theta - truth).abs() < 5.0 * error,
            "k{j}: {theta} ± {error}, {truth} is true"
        );
    }
}

/// A record without a gap, through the detection.
fn tested(chain: Chain, samples: usize) {
    let settings = DiagnoseSettings {
        detection_only: true,
        ..DiagnoseSettings::default()
    };
    let (study, record) = (chain.study(samples), chain.record(1.1, samples, 3));
    let clock = Instant::now();
    let diagnosis = diagnose(&study, &[record], None, &settings, &Progress::silent()).unwrap();
    println!("{samples} samples of {chain:?}: {:.1?}", clock.elapsed());
    assert!(
        diagnosis.detection.log_evidence <= 0.0,
        "{:?}",
        diagnosis.detection
    );
    for parameter in diagnosis.parameters {
        assert!(parameter.refitted.is_finite() && parameter.std_error.is_finite());
    }
}

/// As many parameters as tanks, every other tank measured. Lags stand for scores: the score of twenty parameters takes forty passes of a
/// filter of twenty states, seconds a simulation.
fn many(tanks: usize) {
    let chain = Chain {
        tanks,
        measured: tanks / 2,
        units: Units::PLAIN,
    };
    let lags = Arx {
        outputs: 3,
        inputs: 3,
    };
    let project = Project::from(chain.study(400)).with_features(lags);
    estimated(chain, project, 400, 500);
}

#[test]
fn six_parameters_and_three_outputs() {
    many(6);
}

#[test]
#[ignore = "a minute; run it in release"]
fn ten_parameters_and_five_outputs() {
    many(10);
}

/// `cargo test --release --test science numbers -- --ignored --nocapture`
#[test]
#[ignore = "minutes; run it in release"]
fn twenty_parameters_and_ten_outputs() {
    many(20);
}

#[test]
fn five_thousand_samples() {
    let chain = Chain::pair(Units::PLAIN);
    estimated(chain, chain.study(5_000), 5_000, 100);
}

/// `cargo test --release --test science numbers -- --ignored --nocapture`
#[test]
#[ignore = "minutes; run it in release"]
fn fifty_thousand_samples() {
    let chain = Chain::pair(Units::PLAIN);
    estimated(chain, chain.study(50_000), 50_000, 150);
}

/// `cargo test --release --test science numbers -- --ignored --nocapture`
#[test]
#[ignore = "minutes; run it in release"]
fn a_long_record_is_diagnosed() {
    tested(Chain::pair(Units::PLAIN), 50_000);
}
