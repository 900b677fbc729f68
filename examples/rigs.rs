//! Three small rigs, each with the twin that a newcomer would write: no noise declared, starts not known.
//!
//! `positioning` is a carriage on a screw (Janot, Gautier & Brunot, "Data set and reference models of EMPS", 2019); `heater` the
//! transistor of a temperature control lab (apmonitor.com/heat.htm); `drives` a pulley between two motors (Wigren & Schoukens, "Coupled
//! electric drives data set", 2017). With a record at hand:
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

/// ṁ = (gain·u − m)/τ, p̈ = ω²(m − p) − 2ζω·ṗ: a motor that turns a pulley through a belt.
#[derive(Debug)]
pub struct Drives;

impl StateSpace for Drives {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("gain", "1", 0.5, 10.0).within(0.05, 50.0))
            .parameter(Parameter::new("tau", "s", 0.02, 1.0).within(0.005, 5.0))
            .parameter(Parameter::new("omega", "1/s", 5.0, 50.0).within(1.0, 100.0))
            .parameter(Parameter::new("zeta", "1", 0.01, 1.0).within(0.001, 3.0))
            .state("motor", "V")
            .state("pulley", "V")
            .state("rate", "V/s")
            .input("u", "V")
            .output("y", "V")
    }
    fn drift(&self, now: &Now, x: &[f64], dx: &mut [f64]) {
        let [gain, tau, omega, zeta] = [0, 1, 2, 3].map(|i| now.theta[i]);
        dx[0] = (gain * now.u[0] - x[0]) / tau;
        dx[1] = x[2];
        dx[2] = omega * omega * (x[0] - x[1]) - 2.0 * zeta * omega * x[2];
    }
    fn observe(&self, _: &Now, x: &[f64], y: &mut [f64]) {
        y[0] = x[1];
    }
    fn integrator(&self) -> Integrator {
        Integrator::RungeKutta4
    }
}

fn main() -> ExitCode {
    let carriage = RecordPlan::levels(0.02, 1242, -100.0, 100.0, 50);
    let heater = RecordPlan::levels(1.0, 600, 0.0, 100.0, 60);
    let drives = RecordPlan::levels(0.02, 500, -2.0, 2.0, 25);
    truetwin::cli::run([
        Study::new("positioning", Carriage, carriage),
        Study::new("heater", Heater, heater),
        Study::new("drives", Drives, drives),
    ])
}
