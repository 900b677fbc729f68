//! Tests of whole estimates.

use super::*;
use crate::estimator::estimate::EstimateOptions;
use crate::estimator::pretrain::{PretrainOptions, pretrain};
use crate::study::{RecordPlan, Study, StudyFile};
use crate::twin::Twin;
use crate::twins::CascadedTanks;

/// The tanks, all physical parameters fixed.
fn fixed(tables: &str) -> Study {
    let text = format!("twin = 'tanks'\n[fixed]\nk1 = 0.6\nk2 = 0.6\nk3 = 0.6\nk4 = 0.6\n{tables}");
    let file = StudyFile::parse(&text, "s.toml".as_ref()).unwrap();
    let plan = RecordPlan::levels(0.5, 60, 0.0, 3.0, 30);
    let study = Study::new("tanks", CascadedTanks, plan).unwrap();
    study.configure(&file).unwrap()
}

/// A record of this twin under a drive of the study.
fn record(study: &Study, twin: &Twin, theta: &[f64], noise: Noise) -> Record {
    let drive = study.drives().unwrap().draw(noise).unwrap();
    let outputs = twin.simulate(theta, &drive, noise).unwrap();
    Record::new(drive, outputs).unwrap()
}

const SMALL: PretrainOptions = PretrainOptions {
    preset: crate::estimator::PresetName::Default,
    bank_size: Some(100),
    epochs: Some(1),
    seed: 1,
};

#[test]
fn a_start_alone_is_estimated() {
    let study =
        fixed("[start]\nh1 = 'estimate'\n[features]\nkind = 'arx'\noutputs = 4\ninputs = 4");
    let (estimator, _) = pretrain(&study, &SMALL, &Progress::silent()).unwrap();
    let noise = Noise::new(1, "record", 0);
    let theta = study.twin().parameters().centre();
    let record = record(&study, study.twin(), &theta, noise);
    let estimate = estimator.estimate(&record).unwrap();
    assert_eq!(estimate.names, ["start.h1"]);
    assert!(estimate.std_error[0].is_finite());
}

/// Some records that start above the prior have a p-value within two Monte-Carlo errors of the level: they are tested again, at both gates.
#[test]
fn an_answer_near_the_level_is_taken_from_more_simulations() {
    let study =
        fixed("[start]\nh1 = 'estimate'\n[features]\nkind = 'arx'\noutputs = 4\ninputs = 4");
    let (estimator, _) = pretrain(&study, &SMALL, &Progress::silent()).unwrap();
    let (null, larger) = (
        estimator.settings.gate.null,
        estimator.settings.gate.larger().null,
    );
    let mut theta = study.twin().parameters().centre();
    let (mut first, mut after) = (0, 0);
    for index in 0..20 {
        theta[0] += 0.1;
        let noise = Noise::new(3, "record", index);
        let record = record(&study, study.twin(), &theta, noise);
        let estimate = estimator.estimate(&record).unwrap();
        let tests = [Some(estimate.gate), estimate.after()];
        for (test, repeated) in tests.into_iter().flatten().zip([&mut first, &mut after]) {
            assert!(test.simulations == larger || !test.is_unsure(), "{test:?}");
            assert!([null, larger].contains(&test.simulations), "{test:?}");
            *repeated += usize::from(test.simulations == larger);
        }
        if first > 0 && after > 0 {
            break;
        }
    }
    assert!(first > 0 && after > 0, "{first} and {after} of 20");
}

/// Tanks that declare this measurement noise in place of 0.15.
fn tanks(declared: f64) -> Study {
    let plan = RecordPlan::levels(0.5, 300, 0.5, 3.0, 30);
    let study = Study::new("tanks", CascadedTanks, plan).unwrap();
    let text = format!("twin = 'tanks'\n[noise]\ny = {declared}\n");
    let file = StudyFile::parse(&text, "s.toml".as_ref()).unwrap();
    study.configure(&file).unwrap()
}

fn levels_off(declared: f64, seed: u64) -> Vec<String> {
    let study = tanks(declared);
    let noise = Noise::new(seed, "record", 0);
    let tanks = Twin::new(CascadedTanks);
    let record = record(&study, &tanks, &[0.6, 0.5, 0.55, 1.0], noise);
    let fit = RecordFit::new(
        &study,
        &record,
        &EstimateOptions::default(),
        &Progress::silent(),
    )
    .unwrap();
    let levels = fit.unwrap().levels;
    levels.into_iter().map(|level| level.name).collect()
}

/// A noise three times too small or too large is seen in every record, and the right one is left alone but once.
fn wrong_declarations_are_seen(seeds: std::ops::Range<u64>) {
    for declared in [0.05, 0.45] {
        for seed in seeds.clone() {
            let off = levels_off(declared, seed);
            assert!(off.contains(&"y".to_owned()), "{declared}, {seed}: {off:?}");
        }
    }
    let wrong = seeds.filter(|seed| !levels_off(0.15, *seed).is_empty());
    assert!(wrong.count() <= 1);
}

/// Two records of each: a version that sees one wrong level in two fails with a probability of 0.94, and one that always sees something fails.
#[test]
fn a_wrong_declaration_is_seen() {
    wrong_declarations_are_seen(0..2);
}

#[test]
#[ignore = "half a minute; run it in release"]
fn a_wrong_declaration_is_seen_in_many_records() {
    wrong_declarations_are_seen(0..6);
}
