//! An own twin with an own network, and the whole command line over both.
//!
//! `cargo run --release --example own_architecture -- demo`

use std::process::ExitCode;
use truetwin::network::layers::*;
use truetwin::study::{RecordPlan, Study, StudyError};
use truetwin::twin::*;

/// A mass on a spring, pushed by a force: m·ẍ = u − c·ẋ − k·x, m = 1 kg.
struct Spring;

impl StateSpace for Spring {
    fn outline(&self) -> Outline {
        Outline {
            parameters: ParameterSpace::new([
                Parameter::new("k", "N/m", 1.0, 3.0).within(0.1, 9.0),
                Parameter::new("c", "N·s/m", 0.2, 0.6).within(0.0, 2.0),
            ]),
            states: vec![Quantity::new("x", "m"), Quantity::new("v", "m/s")],
            inputs: vec![Quantity::new("u", "N")],
            outputs: vec![Quantity::new("y", "m")],
        }
    }
    fn drift(&self, now: &Now, x: &[f64], dx: &mut [f64]) {
        dx[0] = x[1];
        dx[1] = now.u[0] - now.theta[1] * x[1] - now.theta[0] * x[0];
    }
    fn observe(&self, _: &Now, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }
    fn noise(&self, _: &Now, process: &mut [f64], measurement: &mut [f64]) {
        process[1] = 0.02;
        measurement[0] = 0.01;
    }
    fn integrator(&self) -> Integrator {
        Integrator::RungeKutta4
    }
}

/// A small network: plain dfdx layers and fused ones mix freely.
struct Small;

impl HeadArchitecture for Small {
    const ID: &'static str = "small";
    const DROPOUT: f64 = 0.05;
    type Features = Const<16>; // at most 16 features
    type Hidden = Const<64>;
    type Trunk = (NormDense<16, 64, Leaky>, Dense<64, 64, Leaky>);
    type Head = (Linear<64, 32>, Tanh, Dropout, Linear<32, 1>);
}

fn study() -> Result<Study, StudyError> {
    let plan = RecordPlan::levels(0.1, 300, -1.0, 1.0, 15);
    Ok(Study::new("spring", Spring, plan)?.with_architecture::<Small>())
}

fn main() -> ExitCode {
    truetwin::cli::run([study()])
}
