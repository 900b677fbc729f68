//! The simulation loop allocates nothing: a longer record costs no more allocations than a short one.

use crate::memory;
use truetwin::study::RecordPlan;
use truetwin::twin::{DigitalTwin, Noise};
use truetwin::twins::{CascadedTanks, VanDerPol};

/// Allocations of one simulation of so many samples.
fn allocations(twin: &dyn DigitalTwin, plan: &RecordPlan, samples: usize, theta: &[f64]) -> usize {
    let mut plan = plan.clone();
    plan.samples = samples;
    let noise = Noise::new(1, "allocations", 0);
    let drive = plan.drive(&twin.signals(), noise).unwrap();
    let (outputs, count) = memory::allocations(|| twin.simulate(theta, &drive, noise));
    outputs.unwrap();
    count
}

#[test]
fn a_longer_record_costs_no_more_allocations() {
    let cases: [(&dyn DigitalTwin, RecordPlan, &[f64]); 2] = [
        (&VanDerPol, RecordPlan::autonomous(0.05, 0), &[1.5]),
        (
            &CascadedTanks,
            RecordPlan::levels(0.5, 0, 0.0, 3.0, 30),
            &[0.6, 0.5, 0.55, 1.0],
        ),
    ];
    for (twin, plan, theta) in cases {
        let [short, long] = [100, 10_000].map(|n| allocations(twin, &plan, n, theta));
        assert_eq!(short, long);
        assert!((1..100).contains(&short), "{short} allocations a record");
    }
}
