//! The refinement finds the parameter of a record.

use super::{GateTest, RefineSettings, Refinement};
use crate::estimator::GateSettings;
use crate::estimator::bank::FeatureSimulator;
use crate::feature::Ar;
use crate::progress::Progress;
use crate::record::{Drive, Record};
use crate::twin::{DigitalTwin, Noise};
use crate::twins::VanDerPol;
use std::sync::Arc;

#[test]
fn one_start_comes_near_the_truth() {
    let simulator = FeatureSimulator::new(Arc::new(VanDerPol), &Ar { order: 5 }).unwrap();
    let drive = Drive::autonomous(0.05, 200).unwrap();
    let outputs = VanDerPol.simulate(&[1.5], &drive, Noise::new(7, "measured", 0));
    let record = Record::new(drive.clone(), outputs.unwrap()).unwrap();
    let observed = simulator.observe(&record).unwrap();
    let few = RefineSettings {
        starts: 1,
        ..RefineSettings::default()
    };
    let refinement = Refinement {
        test: GateTest {
            simulator: &simulator,
            drive: &drive,
            settings: &GateSettings::default(),
            noise: Noise::new(1, "refine", 0),
            progress: &Progress::silent(),
        },
        observed: &observed,
        settings: &few,
    };
    let refined = refinement.run(&[1.2]).unwrap();
    assert!((refined.theta[0] - 1.5).abs() < 0.5);
    assert!(!refined.information.directions[0].weak);
}
