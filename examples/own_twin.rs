//! A twin of one's own with the whole command line: copy this file, change the equations.
//!
//! `cargo run --release --example own_twin -- demo`, or check, simulate, pretrain, estimate, diagnose, …

use truetwin::network::layers::*;
use truetwin::prelude::*;

/// A leaking tank: area·ḣ = u − k·h.
#[derive(Debug)]
pub struct Tank;

impl StateSpace for Tank {
    fn outline(&self) -> Outline {
        // Parameters: name, unit, prior (where the network is trained); then the bounds of what is possible at all.
        Outline::new()
            .parameter(Parameter::new("k", "m²/s", 0.2, 1.0).within(0.01, 3.0))
            .parameter(Parameter::new("area", "m²", 0.5, 1.5).within(0.2, 5.0))
            .state("h", "m")
            .input("u", "m³/s")
            .output("y", "m")
    }
    fn drift(&self, now: &Now, x: &[f64], dx: &mut [f64]) {
        let (k, area) = (now.theta[0], now.theta[1]);
        dx[0] = (now.u[0] - k * x[0]) / area;
    }
    fn observe(&self, _: &Now, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }
    // Standard deviations: of the increment added to the level each step, and of the sensor.
    fn noise(&self, _: &Now, _: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        (process[0], measurement[0]) = (0.01, 0.02);
    }
}

/// A small network: a trunk that all parameters share, and one head for each.
struct Small;

impl HeadArchitecture for Small {
    const ID: &'static str = "small";
    type Features = Const<16>; // at most 16 features
    type Hidden = Const<64>;
    type Trunk = (Dense<16, 64>, Dense<64, 64>);
    type Head = (Dense<64, 32>, Linear<32, 1>);
}

fn main() -> std::process::ExitCode {
    // Records: step in seconds, samples, levels of the input, samples that each is held.
    let records = RecordPlan::levels(0.1, 300, 0.0, 1.0, 20);
    let study = Study::new("tank", Tank, records);
    truetwin::cli::run([study.map(|study| Project::from(study).with_architecture::<Small>())])
}
