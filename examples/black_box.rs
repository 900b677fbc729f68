//! A black box: a heater that is nothing but a function from parameters and inputs to outputs. `diagnose` needs no more.
//!
//! ```console
//! $ cargo run --release --example black_box -- check --twin heater
//! $ cargo run --release --example black_box -- simulate --twin heater --theta gain=2,tau=20 --effect dead.toml --out R.csv
//! $ cargo run --release --example black_box -- diagnose R.csv --twin heater --out gap
//! ```
//!
//! where `dead.toml` says
//!
//! ```toml
//! [[effect]]
//! id = "actuator-dead-zone"
//! target = "actuator"
//! magnitudes = { width = 0.4 }
//! ```

use std::process::ExitCode;
use truetwin::prelude::*;

/// τ·Ṫ = gain·u − T, solved outside of the framework, as a program of one's own would be; the thermometer is noisy.
struct Heater;

impl DigitalTwin for Heater {
    fn parameters(&self) -> ParameterSpace {
        ParameterSpace::new([
            Parameter::new("gain", "K", 1.0, 3.0).within(0.1, 10.0),
            Parameter::new("tau", "s", 10.0, 40.0).within(1.0, 200.0),
        ])
    }

    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        let keep = (-drive.dt() / theta[1]).exp();
        let mut thermometer = noise.source("thermometer");
        let mut temperature = 0.0;
        Ok(drive.inputs().mapv(|u| {
            let measured = temperature + 0.02 * thermometer.normal();
            temperature = keep * temperature + (1.0 - keep) * theta[0] * u;
            measured
        }))
    }
}

fn main() -> ExitCode {
    truetwin::cli::run([Study::new(
        "heater",
        Heater,
        RecordPlan::levels(1.0, 400, -1.0, 1.0, 20),
    )])
}
