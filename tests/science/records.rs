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

/// A first-order plant; starts at rest, says its code.
struct Plant;

impl StateSpace for Plant {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("K", "K/V", 0.5, 4.0).within(0.01, 50.0))
            .parameter(Parameter::new("tau", "s", 1.0, 20.0).within(0.1, 200.0))
            .state("x", "K")
            .input("u", "V")
            .output("y", "K")
    }
    fn drift(&self, now: &Now, x: &[f64], dx: &mut [f64]) {
        dx[0] = (now.theta[0] * now.u[0] - x[0]) / now.theta[1];
    }
    fn observe(&self, _: &Now, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }
    fn start(&self, _: &Now, x: &mut [f64]) {
        x.fill(0.0);
    }
    fn integrator(&self) -> Integrator {
        Integrator::RungeKutta4
    }
}

/// A record of the plant (K 2, τ 5) about a level of the input, whose steps are of this size, from the row on at which it has settled.
fn settled(level: f64, steps: f64, noise: f64, run: u64) -> Record {
    let mut source = Noise::new(run, "levels", 0).source("u");
    let levels: Vec<f64> = (0..60).map(|_| level + steps * source.normal()).collect();
    let inputs = Signal::from_shape_fn((600, 1), |(k, _)| levels[k / 10]);
    let drive = Drive::new(0.5, inputs.clone()).unwrap();
    let whole = Plant.simulate(&[2.0, 5.0], &drive, Noise::OFF).unwrap();
    let mut source = Noise::new(run, "records", 0).source("v");
    let outputs = Signal::from_shape_fn((400, 1), |(k, _)| {
        whole[[k + 200, 0]] + noise * source.normal()
    });
    let inputs = inputs.slice(ndarray::s![200.., ..]).to_owned();
    Record::new(Drive::new(0.5, inputs).unwrap(), outputs).unwrap()
}

fn codes(fit: &Fit) -> Vec<&str> {
    fit.warnings.iter().map(|warning| warning.code).collect()
}

/// A record at an operating point, far from the start of the code and moving little about itself, tells the parameters and says that it began
/// elsewhere. One that begins at the start keeps it.
#[test]
fn a_record_may_begin_at_an_operating_point() {
    let study = Study::of(Plant).unwrap();
    for (level, steps, noise, run) in [(10.0, 0.05, 0.01, 1), (-40.0, 1.0, 0.1, 2)] {
        let fit = study.fit(&[settled(level, steps, noise, run)]).unwrap();
        assert_near(&fit, "K", 2.0);
        assert_near(&fit, "tau", 5.0);
        assert!(
            codes(&fit).contains(&"start-elsewhere"),
            "{:?}",
            fit.warnings
        );
        let follows = fit.errors[0].free_run.unwrap();
        assert!(follows < 1.5 * noise, "{follows}");
    }
    let inputs = Signal::from_shape_fn((200, 1), |(k, _)| [1.0, -0.5, 0.3][k / 20 % 3]);
    let drive = Drive::new(0.5, inputs).unwrap();
    let rest = Plant.simulate(&[2.0, 5.0], &drive, Noise::OFF).unwrap();
    let mut source = Noise::new(3, "records", 0).source("v");
    let rest = rest.mapv(|y| y + 0.05 * source.normal());
    let fit = study.fit(&[Record::new(drive, rest).unwrap()]).unwrap();
    assert_near(&fit, "tau", 5.0);
    assert!(!codes(&fit).contains(&"start-elsewhere"));
    assert_eq!((fit.starts[0].value, fit.starts[0].std_error), (0.0, 0.0));
}

/// Amounts that are absorbed and eliminated: the gut is never measured, and its start is what the code says.
struct Dose;

impl StateSpace for Dose {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("ka", "1/h", 0.2, 5.0).within(0.01, 50.0))
            .parameter(Parameter::new("ke", "1/h", 0.02, 0.5).within(0.001, 5.0))
            .state("gut", "mg")
            .state("blood", "mg")
            .output("y", "mg")
    }
    fn drift(&self, now: &Now, x: &[f64], dx: &mut [f64]) {
        dx[0] = -now.theta[0] * x[0];
        dx[1] = now.theta[0] * x[0] - now.theta[1] * x[1];
    }
    fn observe(&self, _: &Now, x: &[f64], y: &mut [f64]) {
        y[0] = x[1];
    }
    fn start(&self, _: &Now, x: &mut [f64]) {
        x[0] = 100.0;
        x[1] = 0.0;
    }
    fn integrator(&self) -> Integrator {
        Integrator::RungeKutta4
    }
}

/// A start written in code is known: with an unknown dose, fast absorption and slow elimination may change places.
#[test]
fn a_start_written_in_code_is_known() {
    let (ka, ke) = (1.8, 0.15);
    let solution = |t: f64| 100.0 * ka / (ka - ke) * ((-ke * t).exp() - (-ka * t).exp());
    let drive = Drive::autonomous(0.25, 40).unwrap();
    let record = measured(drive, solution, 1.0, 4);
    let fit = Study::of(Dose).unwrap().fit(&[record]).unwrap();
    assert_near(&fit, "ka", ka);
    assert_near(&fit, "ke", ke);
    assert_eq!((fit.starts[0].value, fit.starts[0].std_error), (100.0, 0.0));
}

/// Nothing is left to estimate, and the twin still runs free.
#[test]
fn a_twin_without_free_parameters_runs() {
    let text = "twin = 'twin'\n[fixed]\nK = 2.0\ntau = 5.0\n";
    let study = configured(&Study::of(Plant).unwrap(), text);
    let fit = study.fit(&[settled(1.0, 0.3, 0.05, 5)]).unwrap();
    let follows = fit.errors[0].free_run.unwrap();
    assert!(follows < 0.07, "{follows}");
    assert!(!codes(&fit).contains(&"free-run-diverges"));
}

/// Two coupled rooms with a sensor each.
struct Rooms;

impl StateSpace for Rooms {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("C1", "J/K", 2.0, 20.0).within(0.5, 100.0))
            .parameter(Parameter::new("C2", "J/K", 2.0, 20.0).within(0.5, 100.0))
            .state("T1", "K")
            .state("T2", "K")
            .input("u", "W")
            .output("y1", "K")
            .output("y2", "K")
    }
    fn drift(&self, now: &Now, x: &[f64], dx: &mut [f64]) {
        let flow = 0.5 * (x[0] - x[1]);
        dx[0] = (now.u[0] - 0.3 * x[0] - flow) / now.theta[0];
        dx[1] = (flow - 0.2 * x[1]) / now.theta[1];
    }
    fn observe(&self, _: &Now, x: &[f64], y: &mut [f64]) {
        y.copy_from_slice(x);
    }
    fn integrator(&self) -> Integrator {
        Integrator::RungeKutta4
    }
}

/// One of several records may lack a sensor; a sensor that all of them lack is an error.
#[test]
fn a_record_may_lack_a_sensor() {
    let made = |run: u64| {
        let inputs = Signal::from_shape_fn((150, 1), |(k, _)| {
            [2.0, 0.0, 1.0][(k / 25 + run as usize) % 3]
        });
        let drive = Drive::new(1.0, inputs).unwrap();
        let outputs = Rooms.simulate(&[6.0, 9.0], &drive, Noise::OFF).unwrap();
        let mut source = Noise::new(run, "records", 0).source("v");
        Record::new(drive, outputs.mapv(|y| y + 0.02 * source.normal())).unwrap()
    };
    let without = |record: &Record, output: usize| {
        let mut outputs = record.outputs().clone();
        outputs.column_mut(output).fill(f64::NAN);
        Record::new(record.drive().clone(), outputs).unwrap()
    };
    let study = Study::of(Rooms).unwrap();
    let records = [made(1), without(&made(2), 0)];
    let fit = study.fit(&records).unwrap();
    assert_near(&fit, "C1", 6.0);
    assert_near(&fit, "C2", 9.0);
    let noise = fit.noise.iter().find(|level| level.name == "y1").unwrap();
    assert!((noise.value / 0.02 - 1.0).abs() < 0.3, "{}", noise.value);
    let each = [without(&made(1), 1), without(&made(2), 0)];
    assert_near(&study.fit(&each).unwrap(), "C2", 9.0);
    let score = study.score(&fit, &records[1]).unwrap();
    assert_eq!(score.errors.len(), 1);
    assert!(score.errors[0].free_run.unwrap() < 0.03);
    let refused = study.fit(&records[1..]).unwrap_err().to_string();
    assert!(
        refused.starts_with("output y1 has no value in any record;"),
        "{refused}"
    );
}

/// Rows of one time are readings of one state: a record of three readings a time says as much as three records, and the noise is that of a
/// reading.
#[test]
fn rows_of_one_time_are_replicates() {
    let solution = |t: f64| 5.0 * (-0.7 * t).exp();
    let times: Vec<f64> = (0..36).map(|k| 0.4 * f64::from(k / 3)).collect();
    let repeated = Drive::with_times(&times, Signal::zeros((36, 0))).unwrap();
    let study = Study::of(Decay).unwrap();
    let record = measured(repeated, solution, 0.1, 6);
    let fit = study.fit(std::slice::from_ref(&record)).unwrap();
    assert_near(&fit, "k", 0.7);
    assert_near(&fit, "x0", 5.0);
    let third = |first: usize| {
        let rows: Vec<usize> = (0..12).map(|k| 3 * k + first).collect();
        let outputs = record.outputs().select(ndarray::Axis(0), &rows);
        Record::new(Drive::autonomous(0.4, 12).unwrap(), outputs).unwrap()
    };
    let text = "twin = 'twin'\n[record]\nstep = 0.4\nsamples = 36\n[noise]\nx = { std = 0.0, known = true }\ny = { std = 0.1, known = true }\n";
    let known = configured(&study, text);
    let together = known.fit(std::slice::from_ref(&record)).unwrap();
    let apart = known.fit(&[third(0), third(1), third(2)]).unwrap();
    for (a, b) in together.parameters.iter().zip(&apart.parameters) {
        assert!(
            (a.value - b.value).abs() < 0.02 * b.std_error,
            "{} {}",
            a.value,
            b.value
        );
        assert!((a.std_error / b.std_error - 1.0).abs() < 0.02);
    }
    assert!((together.log_likelihood - apart.log_likelihood).abs() < 1e-3);
    // Readings of a state are no motion: a simulation gives them one state, too.
    let run = Decay
        .simulate(&[0.7, 5.0], record.drive(), Noise::OFF)
        .unwrap();
    assert_eq!(run[[3, 0]], run[[5, 0]]);
    assert!((run[[35, 0]] - solution(4.4)).abs() < 1e-3);
}

/// ẋ = −k·x from x0.
struct Decay;

impl StateSpace for Decay {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("k", "1/s", 0.1, 2.0).within(0.01, 20.0))
            .parameter(Parameter::new("x0", "1", 1.0, 10.0).within(0.1, 100.0))
            .state("x", "1")
            .output("y", "1")
    }
    fn drift(&self, now: &Now, x: &[f64], dx: &mut [f64]) {
        dx[0] = -now.theta[0] * x[0];
    }
    fn observe(&self, _: &Now, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }
    fn start(&self, now: &Now, x: &mut [f64]) {
        x[0] = now.theta[1];
    }
    fn integrator(&self) -> Integrator {
        Integrator::RungeKutta4
    }
}

/// An offset of the sensor looks like another start, until the rest of the record is seen: the diagnosis asks both.
#[test]
fn an_offset_is_no_other_start() {
    let inputs = Signal::from_shape_fn((160, 1), |(k, _)| [1.0, -0.6, 0.4, -1.0][k / 20 % 4]);
    let drive = Drive::new(0.5, inputs).unwrap();
    let run = Plant.simulate(&[2.0, 5.0], &drive, Noise::OFF).unwrap();
    let mut source = Noise::new(8, "records", 0).source("v");
    let offset = run.mapv(|y| y + 6.0 + 0.02 * source.normal());
    let record = Record::new(drive, offset).unwrap();
    let study = Study::of(Plant).unwrap();
    let rivals = [
        "sensor-bias",
        "sensor-gain",
        "sensor-drift",
        "constant-forcing",
    ];
    let settings = DiagnoseSettings {
        quick: true,
        without: (study.effects().iter().map(|e| e.id()))
            .filter(|id| !rivals.contains(id))
            .map(Into::into)
            .collect(),
        ..DiagnoseSettings::default()
    };
    let found = diagnose(&study, &[record], None, &settings, &Progress::silent()).unwrap();
    assert_eq!(found.cause.accepted, ["sensor-bias@sensor"]);
}
