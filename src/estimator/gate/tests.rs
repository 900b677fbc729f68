//! The gate rejects a right θ as often as it says; the paper's form does not.
//!
//! The full figures, over a thousand records of each twin, take minutes:
//! `cargo test --release --lib estimator::gate -- --ignored --nocapture`.

use super::{GateForm, GateSettings, GateTest};
use crate::estimator::bank::FeatureSimulator;
use crate::estimator::refine::Refinement;
use crate::estimator::{PresetName, Project, RefineSettings};
use crate::evaluate::paper::reference_projects;
use crate::feature::{Ar, Arx, FeatureRecipe};
use crate::math::binomial_bounds;
use crate::progress::Progress;
use crate::record::{Drive, Record};
use crate::twin::{DigitalTwin, Noise};
use crate::twins::VanDerPol;
use nalgebra::DVector;
use rayon::prelude::*;
use std::sync::Arc;

#[test]
fn the_right_parameter_passes_and_a_wrong_one_does_not() {
    let simulator = FeatureSimulator::new(Arc::new(VanDerPol), &Ar { order: 2 }).unwrap();
    let drive = Drive::autonomous(0.05, 200).unwrap();
    let outputs = VanDerPol.simulate(&[3.0], &drive, Noise::new(7, "measured", 0));
    let record = Record::new(drive.clone(), outputs.unwrap()).unwrap();
    let features = simulator.observe(&record).unwrap();
    let test = GateTest {
        simulator: &simulator,
        drive: &drive,
        settings: &GateSettings::default(),
        noise: Noise::new(1, "gate", 0),
        progress: &Progress::silent(),
    };
    let right = test.at(&[3.0]).unwrap().test(&features);
    let wrong = test.at(&[1.0]).unwrap().test(&features);
    assert!(!right.out_of_distribution && wrong.out_of_distribution);
}

fn project(name: &str) -> Project {
    let mut projects = reference_projects().unwrap().into_iter();
    projects.find(|p| p.study().name() == name).unwrap()
}

/// Records rejected at the true θ, with a fresh null for each.
fn rejected(name: &str, settings: &GateSettings, records: u64) -> u64 {
    let project = project(name);
    let study = project.study();
    let features = project.recipe(PresetName::Paper).features.clone();
    let simulator = FeatureSimulator::new(study.twin().clone(), features.as_ref()).unwrap();
    let drives = study.drives().unwrap();
    let theta = study.twin().parameters().centre();
    (0..records)
        .into_par_iter()
        .filter(|&i| {
            let record = Noise::new(11, "record", i);
            let drive = drives.draw(record).unwrap();
            let x = simulator
                .features(&[(&theta, &drive, record)])
                .remove(0)
                .unwrap();
            let test = GateTest {
                simulator: &simulator,
                drive: &drive,
                settings,
                noise: Noise::new(11, "null", i),
                progress: &Progress::silent(),
            };
            (test.at(&theta).unwrap())
                .test(&DVector::from_vec(x))
                .out_of_distribution
        })
        .count() as u64
}

fn paper() -> GateSettings {
    GateSettings {
        form: GateForm::Paper,
        ..GateSettings::default()
    }
}

fn assert_calibrated(name: &str, rejected: u64, records: u64) {
    let bounds = binomial_bounds(records, 0.10, 0.999).unwrap();
    println!("{name}: calibrated form rejects {rejected} of {records} at 10 %");
    assert!(
        bounds.contains(&rejected),
        "{name}: {rejected} of {records}, expected {bounds:?}"
    );
}

#[test]
fn five_features() {
    let records = 200;
    let count = rejected("van-der-pol", &GateSettings::default(), records);
    assert_calibrated("van-der-pol", count, records);
}

/// After θ was refitted to the record, the test must not be surprised by how well it fits, α = 0.10.
#[test]
fn after_a_refit_the_test_is_still_calibrated() {
    calibrated_after_a_refit("van-der-pol", &Ar { order: 5 }, 50);
}

fn calibrated_after_a_refit(name: &str, features: &dyn FeatureRecipe, records: u64) {
    let project = project(name);
    let study = project.study();
    let simulator = FeatureSimulator::new(study.twin().clone(), features).unwrap();
    let drives = study.drives().unwrap();
    let space = study.twin().parameters();
    let gate = GateSettings::default();
    let settings = RefineSettings {
        starts: 1,
        ..RefineSettings::default()
    };
    let rejected = (0..records)
        .into_par_iter()
        .filter(|&i| {
            let noise = Noise::new(12, "record", i);
            let drive = drives.draw(noise).unwrap();
            let theta = space.draw_prior(noise);
            let x = simulator
                .features(&[(&theta, &drive, noise)])
                .remove(0)
                .unwrap();
            let observed = DVector::from_vec(x);
            let test = GateTest {
                simulator: &simulator,
                drive: &drive,
                settings: &gate,
                noise: noise.child("after"),
                progress: &Progress::silent(),
            };
            let refinement = Refinement {
                test: GateTest {
                    noise: noise.child("refine"),
                    ..test
                },
                observed: &observed,
                settings: &settings,
            };
            let refined = refinement.run(&space.centre()).unwrap();
            let after = test.after_refit(refined.theta.as_slice(), &refined.jacobian, &observed);
            after.unwrap().unwrap().out_of_distribution
        })
        .count() as u64;
    println!("{name}: after a refit {rejected} of {records} rejected at 10 %");
    let bounds = binomial_bounds(records, 0.10, 0.999).unwrap();
    assert!(
        bounds.contains(&rejected),
        "{name}: {rejected}, expected {bounds:?}"
    );
}

/// The rank is exact whatever the covariance: four simulations a feature are enough to show it.
#[test]
fn a_hundred_and_twenty_eight_features() {
    let settings = GateSettings {
        per_feature: 4,
        null: 99,
        ..GateSettings::default()
    };
    assert_calibrated("tanks", rejected("tanks", &settings, 16), 16);
    assert_eq!(
        rejected("tanks", &paper(), 2),
        2,
        "the paper's form rejects every record"
    );
}

#[test]
#[ignore = "minutes; the figures in docs/method.md"]
fn the_full_figures() {
    let records = 1000;
    for name in ["van-der-pol", "tanks"] {
        let count = rejected(name, &GateSettings::default(), records);
        assert_calibrated(name, count, records);
        let paper = rejected(name, &paper(), records);
        println!("{name}: paper's form rejects {paper} of {records}");
    }
    let arx = Arx {
        outputs: 8,
        inputs: 8,
    };
    calibrated_after_a_refit("tanks", &arx, 100);
}
