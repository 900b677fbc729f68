//! Noise, divergence and lengths of a simulation.

use super::*;
use crate::twin::{DigitalTwin, Parameter, StateSpace};

/// x ← a·x + w, observed with noise; two outputs.
struct Walk;
impl StateSpace for Walk {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("rate", "1/s", -2.0, 30.0))
            .state("x", "m")
            .output("y1", "m")
            .output("y2", "m")
    }
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        dx[0] = now.theta[0] * x[0];
    }
    fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
        y.copy_from_slice(&[x[0], -x[0]]);
    }
    fn start(&self, _: &Now<'_>, x: &mut [f64]) {
        x[0] = 1.0;
    }
    fn noise(&self, _: &Now<'_>, _: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        process[0] = 0.3;
        measurement[1] = 0.2;
    }
}

fn drive(samples: usize) -> Drive {
    Drive::autonomous(0.1, samples).unwrap()
}

#[test]
fn noise_levels_are_standard_deviations() {
    let drive = drive(2);
    let n = 4000u32;
    let [mut increments, mut errors] = [0.0, 0.0];
    for i in 0..n {
        let y = (Walk.simulate(&[0.0], &drive, Noise::new(3, "t", i.into()))).unwrap();
        increments += (y[[1, 0]] - 1.0).powi(2) / f64::from(n);
        errors += (y[[0, 1]] + 1.0).powi(2) / f64::from(n);
    }
    // Relative sd of a variance from n draws: √(2/n) = 0.022; five of them.
    assert!((increments / 0.09 - 1.0).abs() < 0.11, "{increments}");
    assert!((errors / 0.04 - 1.0).abs() < 0.11, "{errors}");
}

#[test]
fn divergence_tells_the_time_and_wrong_lengths_are_fatal() {
    let blown = Walk.simulate(&[1e300], &drive(10), Noise::OFF);
    assert!(matches!(blown, Err(SimulationError::Diverged { at }) if at > 0.0));
    assert!(matches!(
        Walk.simulate(&[], &drive(10), Noise::OFF),
        Err(SimulationError::Fatal(_))
    ));
    let driven = Drive::new(0.1, Signal::zeros((3, 1))).unwrap();
    let error = Walk.simulate(&[0.0], &driven, Noise::OFF).unwrap_err();
    assert!(error.to_string().contains("1 input, the twin has 0"));
}

#[test]
fn common_noise_pairs_runs_at_different_parameters() {
    let noise = Noise::new(5, "t", 0);
    let a = Walk.simulate(&[-1.0], &drive(50), noise).unwrap();
    let b = Walk.simulate(&[-1.0 + 1e-9], &drive(50), noise).unwrap();
    assert!((&a - &b).iter().all(|d| d.abs() < 1e-7));
}

/// ẋ = t on the record's own clock, y = x; starts at 1.
struct Clock;
impl StateSpace for Clock {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("none", "1", 0.5, 1.5))
            .state("x", "m")
            .output("y", "m")
    }
    fn drift(&self, now: &Now<'_>, _: &[f64], dx: &mut [f64]) {
        dx[0] = now.t;
    }
    fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }
    fn start(&self, _: &Now<'_>, x: &mut [f64]) {
        x[0] = 1.0;
    }
    fn integrator(&self) -> crate::twin::Integrator {
        crate::twin::Integrator::RungeKutta4
    }
}

/// Equations see the time of the rows; a start before the first row is run to it, in steps of Δt but for a shorter first one.
#[test]
fn equations_see_the_records_own_time() {
    use crate::twin::{Adaptation, StartLevel, Twin, adapt};
    let late = drive(30).beginning_at(100.0);
    let y = Clock.simulate(&[1.0], &late, Noise::OFF).unwrap();
    let expected = |from: f64, start: f64, k: usize| {
        let t = late.own_time(k);
        start + 0.5 * (t * t - from * from)
    };
    assert!((y[[29, 0]] - expected(100.0, 1.0, 29)).abs() < 1e-9);
    let begun = |at| {
        let start = StartLevel::Declared {
            mean: 2.0,
            std: 0.0,
            at: Some(at),
        };
        let adaptation = Adaptation {
            start: [("x".to_owned(), start)].into(),
            ..Adaptation::default()
        };
        adapt(Twin::new(Clock), &adaptation, 0.1).unwrap()
    };
    for at in [99.97, 97.0, 100.0] {
        let y = begun(at).simulate(&[1.0], &late, Noise::OFF).unwrap();
        for k in [0, 29] {
            assert!((y[[k, 0]] - expected(at, 2.0, k)).abs() < 1e-9, "{at} {k}");
        }
    }
    // Steps to the first row end where the next one begins.
    let Twin::Equations(twin) = begun(73.33) else {
        panic!("equations");
    };
    let acting = Acting::of(&twin, &[1.0], &late).unwrap();
    let steps: Vec<Now<'_>> = (0..acting.steps_before())
        .map(|i| acting.before(i))
        .chain([acting.at(0)])
        .collect();
    assert!(steps.len() > 100);
    for pair in steps.windows(2) {
        assert_eq!(pair[0].end, pair[1].t);
    }
    let problem = begun(100.2).check_drive(&late).unwrap_err().to_string();
    assert!(
        problem.contains("100.2 s, after the first row at 100 s"),
        "{problem}"
    );
    let problem = begun(-1e9).check_drive(&late).unwrap_err().to_string();
    assert!(problem.contains(", 1.0000001e10 steps before"), "{problem}");
    assert!(begun(0.0).check_drive(&late).is_ok());
}
