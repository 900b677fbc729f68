//! Two small rigs, each with the twin that a newcomer would write: no noise declared, starts not known.
//!
//! `positioning` is a carriage on a screw (Janot, Gautier & Brunot, "Data set and reference models of EMPS", 2019); `heater` the
//! transistor of a temperature control lab (apmonitor.com/heat.htm). With a record at hand:
//!
//! ```console
//! $ cargo run --release --example rigs -- fit emps-estimation.csv --twin positioning
//! $ cargo run --release --example rigs -- fit tclab-first.csv --twin heater
//! ```

use std::process::ExitCode;
use truetwin::prelude::*;
use truetwin::twin::Integrator;

/// M·q̈ = F − Fv·q̇: a carriage with viscous friction.
#[derive(Debug)]
pub struct Carriage;

impl StateSpace for Carriage {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("M", "kg", 50.0, 200.0).within(10.0, 1000.0))
            .parameter(Parameter::new("Fv", "N·s/m", 50.0, 1000.0).within(1.0, 5000.0))
            .state("q", "m")
            .state("v", "m/s")
            .input("F", "N")
            .output("y", "m")
    }
    fn drift(&self, now: &Now, x: &[f64], dx: &mut [f64]) {
        let [mass, friction] = [now.theta[0], now.theta[1]];
        dx[0] = x[1];
        dx[1] = (now.u[0] - friction * x[1]) / mass;
    }
    fn observe(&self, _: &Now, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }
    fn integrator(&self) -> Integrator {
        Integrator::RungeKutta4
    }
}

/// Ṫ = (Ta + K·Q − T)/τ: a heater without any delay.
#[derive(Debug)]
pub struct Heater;

impl StateSpace for Heater {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("Ta", "°C", 15.0, 30.0).within(0.0, 50.0))
            .parameter(Parameter::new("K", "°C/%", 0.2, 2.0).within(0.01, 10.0))
            .parameter(Parameter::new("tau", "s", 50.0, 400.0).within(10.0, 2000.0))
            .state("T", "°C")
            .input("Q", "%")
            .output("y", "°C")
    }
    fn drift(&self, now: &Now, x: &[f64], dx: &mut [f64]) {
        let [ambient, gain, tau] = [now.theta[0], now.theta[1], now.theta[2]];
        dx[0] = (ambient + gain * now.u[0] - x[0]) / tau;
    }
    fn observe(&self, _: &Now, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }
    fn start(&self, _: &Now, x: &mut [f64]) {
        x[0] = 20.0;
    }
    fn integrator(&self) -> Integrator {
        Integrator::RungeKutta4
    }
}

fn main() -> ExitCode {
    let carriage = RecordPlan::levels(0.02, 1242, -100.0, 100.0, 50);
    let heater = RecordPlan::levels(1.0, 600, 0.0, 100.0, 60);
    truetwin::cli::run([
        Study::new("positioning", Carriage, carriage),
        Study::new("heater", Heater, heater),
    ])
}
