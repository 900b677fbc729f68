//! Records as people have them: their own time, starts before the first row, operating points, missing sensors, replicates.

use std::path::Path;
use truetwin::fit::Fit;
use truetwin::prelude::*;
use truetwin::study::StudyFile;
use truetwin::twin::Integrator;

/// ẋ = −k·x + A·cos(t/2), t the time of the record's rows; starts at `start`.
struct Driven {
    start: f64,
}

impl StateSpace for Driven {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("k", "1/s", 0.1, 2.0).within(0.01, 20.0))
            .parameter(Parameter::new("A", "1/s", 0.5, 3.0).within(0.01, 10.0))
            .state("x", "1")
            .output("y", "1")
    }
    fn drift(&self, now: &Now, x: &[f64], dx: &mut [f64]) {
        dx[0] = -now.theta[0] * x[0] + now.theta[1] * (0.5 * now.t).cos();
    }
    fn observe(&self, _: &Now, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }
    fn start(&self, _: &Now, x: &mut [f64]) {
        x[0] = self.start;
    }
    fn integrator(&self) -> Integrator {
        Integrator::RungeKutta4
    }
}

/// x(t) of [`Driven`] with x(0) = 2 where k = 0.8, A = 1.5.
fn driven(t: f64) -> f64 {
    let (k, a, w) = (0.8, 1.5, 0.5);
    let forced = |t: f64| a * (k * (w * t).cos() + w * (w * t).sin()) / (k * k + w * w);
    forced(t) + (2.0 - forced(0.0)) * (-k * t).exp()
}

/// Rows of a solution with white noise of this deviation, on a drive's own clock.
fn measured(drive: Drive, solution: impl Fn(f64) -> f64, noise: f64, run: u64) -> Record {
    let mut source = Noise::new(run, "records", 0).source("v");
    let outputs = Signal::from_shape_fn((drive.samples(), 1), |(k, _)| {
        solution(drive.own_time(k)) + noise * source.normal()
    });
    Record::new(drive, outputs).unwrap()
}

fn configured(study: &Study, text: &str) -> Study {
    let file = StudyFile::parse(text, Path::new("s.toml")).unwrap();
    study.configure(&file).unwrap()
}

fn assert_near(fit: &Fit, name: &str, expected: f64) {
    let value = fit.parameters.iter().find(|p| p.name == name).unwrap();
    let off = (value.value - expected).abs();
    assert!(
        off < 4.0 * value.std_error && off < 0.1 * expected,
        "{name}: {} ± {}, expected {expected}",
        value.value,
        value.std_error
    );
}

/// Equations that depend on time see that of the rows, whether steps vary or not; a start may belong to a time before the first row, and then
/// says what the first row alone cannot.
#[test]
fn time_is_the_records_own() {
    let study = Study::of(Driven { start: 0.0 }).unwrap();
    let late = Drive::autonomous(0.1, 200).unwrap().beginning_at(100.0);
    let times: Vec<f64> = (0..150)
        .map(|k| 30.0 + 0.1 * f64::from(k) + 0.03 * f64::from(k % 3))
        .collect();
    let uneven = Drive::with_times(&times, Signal::zeros((150, 0))).unwrap();
    for drive in [late, uneven] {
        let record = measured(drive, driven, 0.02, 1);
        let fit = study.fit(&[record]).unwrap();
        assert_near(&fit, "k", 0.8);
        assert_near(&fit, "A", 1.5);
    }
    let early = Drive::autonomous(0.05, 40).unwrap().beginning_at(1.0);
    let record = measured(early, driven, 0.02, 2);
    let declared = |at: &str| {
        let text = format!("twin = 'twin'\n[start]\nx = {{ value = 2.0, at = {at} }}\n");
        configured(&study, &text).fit(std::slice::from_ref(&record))
    };
    let fit = declared("0.0").unwrap();
    assert_near(&fit, "k", 0.8);
    assert_near(&fit, "A", 1.5);
    let follows = fit.errors[0].free_run.unwrap();
    assert!(follows < 0.03, "{follows}");
    let refused = declared("1.5").unwrap_err().to_string();
    assert!(refused.contains("after the first row at 1 s"), "{refused}");
}
