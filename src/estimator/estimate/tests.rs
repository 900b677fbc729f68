//! Tests of whole estimates.

use super::*;
use crate::estimator::estimate::EstimateOptions;
use crate::estimator::pretrain::{PretrainOptions, pretrain};
use crate::study::{RecordPlan, Study, StudyFile};
use crate::twins::CascadedTanks;

/// The tanks, all physical parameters fixed.
fn fixed(tables: &str) -> Study {
    let text = format!("twin = 'tanks'\n[fixed]\nk1 = 0.6\nk2 = 0.6\nk3 = 0.6\nk4 = 0.6\n{tables}");
    let file = StudyFile::parse(&text, "s.toml".as_ref()).unwrap();
    let plan = RecordPlan::levels(0.5, 60, 0.0, 3.0, 30);
    let study = Study::new("tanks", CascadedTanks, plan).unwrap();
    study.configure(&file).unwrap()
}

const SMALL: PretrainOptions = PretrainOptions {
    preset: crate::estimator::recipe::PresetName::Default,
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
    let drive = study.drives().unwrap().draw(noise).unwrap();
    let theta = study.twin().parameters().centre();
    let outputs = study.twin().simulate(&theta, &drive, noise).unwrap();
    let record = Record::new(drive, outputs).unwrap();
    let estimate = estimator
        .estimate(&record, &EstimateOptions::default(), &Progress::silent())
        .unwrap();
    assert_eq!(estimate.names, ["start.h1"]);
    assert!(estimate.std_error[0].is_finite());
}

/// About one record in twelve has a p-value within two Monte-Carlo errors of the level: it is tested again, at both gates.
#[test]
fn an_answer_near_the_level_is_taken_from_more_simulations() {
    let study =
        fixed("[start]\nh1 = 'estimate'\n[features]\nkind = 'arx'\noutputs = 4\ninputs = 4");
    let (estimator, _) = pretrain(&study, &SMALL, &Progress::silent()).unwrap();
    let (null, larger) = (
        estimator.settings.gate.null,
        estimator.settings.gate.larger().null,
    );
    let theta = study.twin().parameters().centre();
    let (mut first, mut after) = (0, 0);
    for index in 0..40 {
        let noise = Noise::new(3, "record", index);
        let drive = study.drives().unwrap().draw(noise).unwrap();
        let outputs = study.twin().simulate(&theta, &drive, noise).unwrap();
        let record = Record::new(drive, outputs).unwrap();
        let estimate = estimator
            .estimate(&record, &EstimateOptions::default(), &Progress::silent())
            .unwrap();
        let tests = [Some(estimate.gate), estimate.after];
        for (test, repeated) in tests.into_iter().flatten().zip([&mut first, &mut after]) {
            assert!(test.simulations == larger || !test.is_unsure(), "{test:?}");
            assert!([null, larger].contains(&test.simulations), "{test:?}");
            *repeated += usize::from(test.simulations == larger);
        }
    }
    assert!(first > 0 && after > 0, "{first} and {after} of 40");
}
