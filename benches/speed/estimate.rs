//! One record of each reference twin, outside the prior, in the default preset: gate, Gauss–Newton, and the whole estimate with
//! tuned heads. The estimator is trained on a small bank, outside the timing.

use crate::Clock;
use std::time::Duration;
use truetwin::estimator::{EstimateOptions, PretrainOptions, pretrain};
use truetwin::evaluate::paper::reference_studies;
use truetwin::progress::Progress;
use truetwin::record::Record;
use truetwin::report::Report;
use truetwin::study::Study;
use truetwin::twin::Noise;

/// A record at the paper's first test point.
fn outside(study: &Study) -> Result<Record, Box<dyn std::error::Error>> {
    let theta: &[f64] = match study.name() {
        "van-der-pol" => &[3.0],
        _ => &[1.2, 1.2, 0.9, 1.0],
    };
    let noise = Noise::new(1, "record", 0);
    let drive = study.drive(noise)?;
    let outputs = study.twin().simulate(theta, &drive, noise)?;
    Ok(Record::new(drive, outputs)?)
}

pub fn run(clock: &Clock) {
    if !clock.wants("estimate") {
        return;
    }
    let silent = Progress::silent();
    for study in reference_studies().expect("the reference studies are sound") {
        let small = PretrainOptions {
            bank_size: Some(2000),
            epochs: Some(10),
            ..PretrainOptions::default()
        };
        let (estimator, _) = pretrain(&study, &small, &silent).expect("it trains");
        let record = outside(&study).expect("the twin can be simulated there");
        let name = |part: &str| format!("estimate: {}, {part}", study.name());
        let options = EstimateOptions {
            always_refine: true,
            ..EstimateOptions::default()
        };
        let refined =
            || (estimator.estimate_with(&record, &options, &silent)).expect("it is estimated");
        for (part, key) in [("gate", "gate"), ("Gauss–Newton", "gauss_newton")] {
            clock.print(&name(part), 1, |calls| {
                let seconds = (0..calls).filter_map(|_| {
                    let result = refined().json(&study);
                    result["seconds"][key].as_f64()
                });
                Duration::from_secs_f64(seconds.sum())
            });
        }
        clock.time(&name("refined and tuned"), 1, refined);
    }
}
