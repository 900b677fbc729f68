//! The Silverbox, an electronic mass on a spring, with the twin that a newcomer would write: linear.
//!
//! The real circuit's spring is not linear (Wigren & Schoukens, "Three free data sets for development and benchmarking in
//! nonlinear system identification", 2013). With its records at hand:
//!
//! ```console
//! $ cargo run --release --example silverbox -- check --twin silverbox
//! $ cargo run --release --example silverbox -- diagnose silverbox-multisine-estimation.csv --twin silverbox \
//!       --validation silverbox-arrow-validation.csv --out gap
//! ```

use std::process::ExitCode;
use truetwin::prelude::*;
use truetwin::twin::{Hold, Integrator, Stepping};

/// Step of the records: 610.35 Hz.
const STEP: f64 = 0.0016384;

/// ẍ = b·u − c·ẋ − k·x, in volts: the circuit resonates near 70 Hz. The sensor has an offset.
struct Silverbox;

impl StateSpace for Silverbox {
    fn outline(&self) -> Outline {
        Outline {
            parameters: ParameterSpace::new([
                Parameter::new("k", "1/s²", 1.2e5, 2.4e5).within(0.5e5, 5e5),
                Parameter::new("c", "1/s", 10.0, 60.0).within(1.0, 300.0),
                Parameter::new("b", "1/s²", 0.6e5, 3e5).within(1e4, 8e5),
                Parameter::new("offset", "V", -0.01, 0.01).within(-0.1, 0.1),
            ]),
            states: vec![Quantity::new("x", "V"), Quantity::new("v", "V/s")],
            inputs: vec![Quantity::new("u", "V")],
            outputs: vec![Quantity::new("y", "V")],
            ..Outline::new()
        }
    }
    fn drift(&self, now: &Now, x: &[f64], dx: &mut [f64]) {
        dx[0] = x[1];
        dx[1] = now.theta[2] * now.u[0] - now.theta[1] * x[1] - now.theta[0] * x[0];
    }
    fn observe(&self, now: &Now, x: &[f64], y: &mut [f64]) {
        y[0] = x[0] + now.theta[3];
    }
    /// The converter's noise alone: what the twin lacks is not to pass for process noise.
    fn noise(&self, _: &Now, _: &[f64], _: &mut [f64], measurement: &mut [f64]) {
        measurement[0] = 0.001;
    }
    fn integrator(&self) -> Integrator {
        Integrator::RungeKutta4
    }
    /// The input is smooth, and was sampled together with the output.
    fn stepping(&self) -> Stepping {
        Stepping {
            substeps: 2,
            hold: Hold::Nearest,
            ..Stepping::default()
        }
    }
}

fn main() -> ExitCode {
    let plan = RecordPlan::levels(STEP, 2000, -0.1, 0.1, 5);
    truetwin::cli::run([Study::new("silverbox", Silverbox, plan)])
}
