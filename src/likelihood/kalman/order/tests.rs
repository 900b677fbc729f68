//! Outputs with a dead time, beside a register of states.

use crate::effect::{Catalogue, Effect, EffectKind, augment};
use crate::likelihood::kalman::{Coordinates, FilterSettings, Kalman, Score};
use crate::record::{Drive, Record, Signal};
use crate::twin::{
    Adaptation, Integrator, Noise, Now, Outline, Parameter, StartLevel, StateSpace, Twin, adapt,
    fix,
};

const LATE: usize = 6;
const STEP: f64 = 0.2;

/// A leak that is pushed, seen by two sensors; with this process noise of a step.
struct Leak(f64, Integrator);

/// Without process noise, whatever its steps are.
const QUIET: Leak = Leak(0.0, Integrator::Adaptive);

impl StateSpace for Leak {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("rate", "1/s", 0.1, 2.0))
            .state("x", "m")
            .input("u", "m/s")
            .output("now", "m")
            .output("later", "m")
    }
    fn integrator(&self) -> Integrator {
        self.1
    }
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        dx[0] = now.u[0] - now.theta[0] * x[0];
    }
    fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
        y.fill(x[0]);
    }
    fn start(&self, _: &Now<'_>, x: &mut [f64]) {
        x.fill(1.0);
    }
    fn start_deviation(&self, _: &Now<'_>, std: &mut [f64]) {
        std[0] = 0.5;
    }
    fn noise(&self, _: &Now<'_>, _: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        process[0] = self.0;
        measurement.copy_from_slice(&[0.4, 0.1]);
    }
}

/// The leak whose second sensor shows it some samples later, by an effect.
fn late(leak: Leak, effect: &Effect) -> Twin {
    let twin = augment(Twin::new(leak), vec![effect.clone()]).unwrap();
    fix(twin, &effect.given_by_parameter().collect()).unwrap()
}

/// The leak whose second sensor is late by so many seconds.
fn late_by(leak: Leak, delay: f64) -> Twin {
    let effect = Catalogue::default().effect("sensor-delay", "sensor2");
    late(leak, &effect.unwrap().hold("delay", delay))
}

fn by_dead_time() -> Twin {
    late_by(Leak(0.3, Integrator::Euler), LATE as f64 * STEP)
}

fn by_register() -> Twin {
    let register = EffectKind::sensor("register", "", |_, _, past, s| {
        past.rotate_right(1);
        past[0] = s;
        past[LATE]
    });
    let register = register.memory(LATE + 1);
    let library = Catalogue::default().with(register);
    late(
        Leak(0.3, Integrator::Euler),
        &library.effect("register", "sensor2").unwrap(),
    )
}

fn record(seed: u64) -> Record {
    let inputs = Signal::from_shape_fn((90, 1), |(k, _)| (0.3 * k as f64).sin());
    let drive = Drive::new(STEP, inputs).unwrap();
    let outputs = by_dead_time().simulate(&[0.7], &drive, Noise::new(seed, "late", 0));
    Record::new(drive, outputs.unwrap()).unwrap()
}

fn with<T>(twin: &Twin, record: &Record, then: impl FnOnce(&Kalman<'_>) -> T) -> T {
    let settings = FilterSettings::default();
    then(&Kalman::new(twin.equations().unwrap(), record, &settings).unwrap())
}

/// A linear twin: both filters are exact, so that all values together have one density, the first ones and missing ones included.
#[test]
fn a_dead_time_is_a_register_of_states() {
    let whole = record(1);
    let (dead_time, register) = (by_dead_time(), by_register());
    let run = |twin: &Twin| twin.free_run(&[0.7], whole.drive()).unwrap();
    let difference = run(&dead_time) - run(&register);
    assert!(difference.iter().all(|d| d.abs() < 1e-12));
    let mut outputs = whole.outputs().clone();
    for (k, j) in [(2, 1), (40, 0), (41, 0), (41, 1), (88, 1)] {
        outputs[[k, j]] = f64::NAN;
    }
    let gappy = Record::new(whole.drive().clone(), outputs).unwrap();
    for record in [&whole, &gappy] {
        for theta in [[0.7], [1.1]] {
            let expected = with(&register, record, |k| k.filter(&theta).unwrap());
            let found = with(&dead_time, record, |k| k.filter(&theta).unwrap());
            let error = found.log_likelihood - expected.log_likelihood;
            assert!(error.abs() < 1e-8, "{error}");
            let sum: f64 = found.log_densities.iter().sum();
            assert!((sum - found.log_likelihood).abs() < 1e-8);
            for (cell, y) in record.outputs().indexed_iter() {
                assert_eq!(y.is_nan(), found.innovations[cell] == 0.0, "{cell:?}");
            }
        }
        let score = |twin: &Twin| {
            with(twin, record, |k| {
                Score::forward(k, &[0.9], &Coordinates::new(k.parameters())).unwrap()
            })
        };
        let (own, expected) = (score(&dead_time), score(&register));
        let error = own.gradient[0] - expected.gradient[0];
        assert!(
            error.abs() < 1e-3 * expected.fisher[(0, 0)].sqrt(),
            "{error}"
        );
    }
}

/// A prediction knows nothing of its own row and later ones. It is not much worse than one from all rows before; of an
/// output as late and as precise as this one, beside much process noise, it misses what the other has shown since.
#[test]
fn predictions_do_not_see_the_future() {
    let whole = record(2);
    let dead_time = by_dead_time();
    let all = with(&dead_time, &whole, |k| k.predictions(&[0.7]).unwrap());
    for from in [0, 3, LATE, 20, 60, 88] {
        let mut outputs = whole.outputs().clone();
        outputs
            .slice_mut(ndarray::s![from.., ..])
            .mapv_inplace(|y| y + 5.0);
        let other = Record::new(whole.drive().clone(), outputs).unwrap();
        let other = with(&dead_time, &other, |k| k.predictions(&[0.7]).unwrap());
        for k in 0..=from {
            assert_eq!(all.row(k), other.row(k), "row {k} of {from}");
        }
        assert_ne!(all, other);
    }
    let error = |predicted: &Signal| {
        let squares = (whole.outputs() - predicted).mapv(|e| e * e);
        [0, 1].map(|j| squares.column(j).sum())
    };
    let own = error(&all);
    let best = error(&with(&by_register(), &whole, |k| {
        k.predictions(&[0.7]).unwrap()
    }));
    for ((own, best), most) in own.iter().zip(best).zip([1.3, 2.0]) {
        assert!((0.95..most).contains(&(own / best)), "{own} of {best}");
    }
}

/// Rows at uneven times: without process noise a filter that knows the start predicts each output as a run has it, a late one between samples as well.
#[test]
fn a_dead_time_counts_seconds_where_steps_vary() {
    let times: Vec<f64> = (0..60)
        .map(|k: u32| STEP * (f64::from(k) + f64::from(k * k % 5) * 0.17 + f64::from(k / 20)))
        .collect();
    let inputs = Signal::from_shape_fn((times.len(), 1), |(k, _)| (0.3 * k as f64).sin());
    let drive = Drive::with_times(&times, inputs).unwrap();
    for delay in [0.05, 0.3, 1.23] {
        let twin = late_by(QUIET, delay);
        let outputs = twin.free_run(&[0.7], &drive).unwrap();
        let record = Record::new(drive.clone(), outputs.clone()).unwrap();
        let [filtered, predicted] = [true, false].map(|all| {
            with(&twin, &record, |k| match all {
                true => k.filter(&[0.7]).unwrap().predictions(&outputs),
                false => k.predictions(&[0.7]).unwrap(),
            })
        });
        for found in [filtered, predicted] {
            let off = (&found - &outputs)
                .iter()
                .fold(0.0, |off: f64, d| off.max(d.abs()));
            assert!(off < 1e-6, "{delay} s: {off}");
        }
    }
}

/// Rows that are left out say no more than rows without values, where each late value shows a sample that is there.
#[test]
fn rows_that_are_left_out_are_rows_without_values() {
    let is_there = |k: &usize| ![2, 3].contains(&(k % LATE));
    let rows: Vec<usize> = (0..90).filter(is_there).collect();
    let input =
        |k: usize| (0.3 * (if is_there(&k) { k } else { k / LATE * LATE + 1 }) as f64).sin();
    let drive = Drive::new(STEP, Signal::from_shape_fn((90, 1), |(k, _)| input(k))).unwrap();
    let twin = late_by(QUIET, LATE as f64 * STEP);
    let outputs = twin.simulate(&[0.7], &drive, Noise::new(3, "late", 0));
    let outputs = outputs.unwrap();
    let mut empty = outputs.clone();
    for k in (0..90).filter(|k| !is_there(k)) {
        empty.row_mut(k).fill(f64::NAN);
    }
    let whole = Record::new(drive, empty).unwrap();
    let times: Vec<f64> = rows.iter().map(|k| STEP * *k as f64).collect();
    let of_rows = |signal: &Signal| signal.select(ndarray::Axis(0), &rows);
    let drive = Drive::with_times(&times, of_rows(whole.drive().inputs())).unwrap();
    let fewer = Record::new(drive, of_rows(&outputs)).unwrap();
    for theta in [[0.7], [1.1]] {
        let [one, other] = [&whole, &fewer]
            .map(|record| with(&twin, record, |k| k.log_likelihood(&theta).unwrap()));
        assert!((one - other).abs() < 1e-4, "{one} {other}");
    }
}

/// A record that begins after the start of its twin: what is late shows the states on the way to the first row, in a run and in a filter.
#[test]
fn a_late_output_shows_what_was_before_the_first_row() {
    let seen = |t: f64| 1.0 / 0.7 + (1.0 - 1.0 / 0.7) * (-0.7 * t.max(0.0)).exp();
    let start = StartLevel::Declared {
        mean: 1.0,
        std: 0.0,
        at: Some(0.0),
    };
    let adaptation = Adaptation {
        start: [("x".to_owned(), start)].into(),
        ..Adaptation::default()
    };
    let delays = [LATE as f64 * STEP, 0.53];
    for (delay, is_even) in delays.into_iter().flat_map(|d| [(d, true), (d, false)]) {
        let twin = adapt(late_by(QUIET, delay), &adaptation, STEP).unwrap();
        for begins in [0.05, 0.6, 2.3] {
            let rows = (0..40).filter(|k| is_even || k % 7 != 5);
            let times: Vec<f64> = rows.map(|k| begins + STEP * f64::from(k)).collect();
            let inputs = Signal::from_elem((times.len(), 1), 1.0);
            let drive = Drive::with_times(&times, inputs).unwrap();
            let run = twin.free_run(&[0.7], &drive).unwrap();
            for (k, t) in times.iter().enumerate() {
                let off = run[[k, 1]] - seen(t - delay);
                assert!(
                    off.abs() < 3e-3,
                    "{delay} {is_even} {begins}: row {k}: {off}"
                );
            }
            let record = Record::new(drive, run.clone()).unwrap();
            let filtered = with(&twin, &record, |k| k.filter(&[0.7]).unwrap());
            let off = filtered
                .innovations
                .iter()
                .fold(0.0, |off: f64, d| off.max(d.abs()));
            assert!(off < 1e-6, "{delay} {is_even} {begins}: {off}");
        }
    }
}
