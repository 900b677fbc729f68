//! Twins with one flaw each.

use super::step::{blamed_step, step_error};
use super::*;
use crate::record::{Quantity, Signals};
use crate::twin::fixture::OneState;
use crate::twin::{Integrator, Now, Outline, StateSpace, Twin};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// y = a·b·k/10 + noise, with a flaw.
struct Flawed(Flaw, AtomicU64);
#[derive(PartialEq)]
enum Flaw {
    None,
    KeepsState,
    RunsOnce,
    DrawsDependOnTheta,
    Diverges,
    Product,
}
impl DigitalTwin for Flawed {
    fn parameters(&self) -> ParameterSpace {
        ParameterSpace::new(["a", "b"].map(|n| Parameter::new(n, "", 1.0, 2.0)))
    }
    fn signals(&self) -> Signals {
        Signals {
            inputs: vec![],
            outputs: vec![Quantity::new("y", "")],
        }
    }
    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        let (a, b) = (theta[0], theta[1]);
        let mut source = noise.source("v");
        if self.0 == Flaw::DrawsDependOnTheta {
            source = noise.source(&format!("{a}"));
        }
        if self.0 == Flaw::Diverges && a * b > 3.9 {
            return Err(SimulationError::Diverged { at: 1.0 });
        }
        let calls = self.1.fetch_add(1, Ordering::Relaxed) as f64;
        if self.0 == Flaw::RunsOnce && calls > 0.0 {
            return Err(SimulationError::Diverged { at: 1.0 });
        }
        let shift = if self.0 == Flaw::KeepsState {
            calls
        } else {
            0.0
        };
        Ok(Signal::from_shape_fn((drive.samples(), 1), |(k, _)| {
            let k = k as f64 / 10.0;
            let trend = 30.0
                * if self.0 == Flaw::Product {
                    a * b * k
                } else {
                    a * k + b * k * k
                };
            trend + shift + source.normal()
        }))
    }
}

fn checked(flaw: Flaw) -> Vec<Finding> {
    let drive = Drive::autonomous(0.1, 30).unwrap();
    check(&Flawed(flaw, AtomicU64::new(0)), &drive, 1)
}

fn worst(flaw: Flaw) -> Vec<(&'static str, Severity)> {
    (checked(flaw).into_iter())
        .filter(|f| f.severity > Severity::Pass)
        .map(|f| (f.check, f.severity))
        .collect()
}

#[test]
fn each_flaw_is_found_and_a_good_twin_passes() {
    assert_eq!(worst(Flaw::None), []);
    let of_state = worst(Flaw::KeepsState);
    assert!(of_state.contains(&("repeatable", Severity::Failure)));
    assert!(of_state.iter().all(|(check, _)| *check != "paired"));
    assert_eq!(
        worst(Flaw::DrawsDependOnTheta)[0],
        ("paired", Severity::Failure)
    );
    assert_eq!(worst(Flaw::Diverges), [("finite", Severity::Warning)]);
    // A run that fails is not one that differs.
    let once = checked(Flaw::RunsOnce);
    let again = once.iter().find(|f| f.check == "repeatable").unwrap();
    assert!(again.message.contains("a second run"), "{}", again.message);
}

/// ẋ = −k·(x − u) from 0, y₁ = x with noise, y₂ = x without.
struct Lag;
impl StateSpace for Lag {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("k", "1/s", 0.1, 20.0))
            .state("x", "V")
            .input("u", "V")
            .output("y1", "V")
            .output("y2", "V")
    }
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        dx[0] = now.theta[0] * (now.u[0] - x[0]);
    }
    fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
        y.fill(x[0]);
    }
    fn noise(&self, _: &Now<'_>, _: &[f64], _: &mut [f64], measurement: &mut [f64]) {
        measurement[0] = 0.05;
    }
}

#[test]
fn a_step_that_is_too_long_is_named_by_output() {
    let inputs = Signal::from_shape_fn((100, 1), |(k, _)| (k / 20 % 2) as f64);
    let drive = Drive::new(0.1, inputs).unwrap();
    let twin = Twin::new(Lag);
    let slow = check_step(&twin, &[0.1], &drive).unwrap();
    assert_eq!(slow.severity, Severity::Pass, "{}", slow.message);
    let stiff = check_step(&twin, &[15.0], &drive).unwrap();
    assert_eq!(stiff.severity, Severity::Warning);
    for part in [
        "y1 moves by",
        "its noise is 0.05 V",
        "y2 moves by",
        "1 % of its deviation is",
        "16 substeps, or the integrator adaptive",
    ] {
        assert!(stiff.message.contains(part), "{}", stiff.message);
    }
    let errors = step_error(&twin, &[15.0], &drive).unwrap();
    assert_eq!(errors[1].0, "y2");
    assert!(errors[1].1 > 0.05, "{errors:?}");
    // What it advises helps.
    let finer = twin.stepped(|_, stepping| stepping.substeps = 16).unwrap();
    let fine = check_step(&finer, &[15.0], &drive).unwrap();
    assert_eq!(fine.severity, Severity::Pass, "{}", fine.message);
    // A step that makes the run diverge is named as such; a run that would diverge with any step is not.
    let wild = check_step(&twin, &[2e5], &drive).unwrap();
    assert!(
        wild.message.contains("the integrator adaptive"),
        "{}",
        wild.message
    );
    let large = blamed_step(&twin, &[250.0], &drive);
    assert!(large.is_some(), "a run that ends at 1e110 is blamed");
    assert!(blamed_step(&twin, &[15.0], &drive).is_none());
    let growing = check_step(&twin, &[-2e5], &drive).unwrap();
    assert!(growing.message.contains("not known"), "{}", growing.message);
    let boxed: Arc<dyn DigitalTwin> = Arc::new(Flawed(Flaw::None, AtomicU64::new(0)));
    assert!(check_step(&Twin::from(boxed), &[1.0, 1.0], &drive).is_none());
}

/// A black box's mean over seeds cannot be flat to 1e-6, but a product's direction is: draws are paired.
#[test]
fn an_unidentifiable_product_is_named() {
    let drive = Drive::autonomous(0.1, 30).unwrap();
    let twin = Flawed(Flaw::Product, AtomicU64::new(0));
    let finding = check(&twin, &drive, 1).pop().unwrap();
    assert_eq!(finding.severity, Severity::Warning);
    assert!(
        finding.message.contains("0.71·a − 0.71·b"),
        "{}",
        finding.message
    );
}

/// A quadratic map: whoever moves θ by 1e-9 of the prior's width sees another orbit, with noise and without.
#[test]
fn chaos_is_no_fault_of_the_draws() {
    let a = Parameter::new("a", "1", 1.55, 1.73).within(1.0, 2.0);
    let map = OneState {
        noise: [0.0, 0.01],
        start: Some(0.0),
        integrator: Integrator::Discrete,
        ..OneState::new([a], |theta, _, x| 1.0 - theta[0] * x * x)
    };
    let drive = Drive::new(1.0, Signal::zeros((100, 1))).unwrap();
    let found = check(&Twin::new(map), &drive, 1);
    let paired = found.iter().find(|f| f.check == "paired").unwrap();
    assert_eq!(paired.severity, Severity::Warning, "{}", paired.message);
    assert!(paired.message.contains("chaotic"), "{}", paired.message);
}
