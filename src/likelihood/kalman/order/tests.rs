//! Outputs with a dead time, beside a register of states.

use crate::likelihood::kalman::{Coordinates, FilterSettings, Kalman, Score};
use crate::record::{Drive, Record, Signal};
use crate::twin::{DigitalTwin, Noise, Now, Outline, Parameter, StateSpace};

const LATE: usize = 6;

/// A leak that is pushed, seen by one sensor at once and by another one some samples later: by a dead time, or by a register of states.
struct Leak {
    register: usize,
}

impl StateSpace for Leak {
    fn outline(&self) -> Outline {
        let outline = Outline::new()
            .parameter(Parameter::new("rate", "1/s", 0.1, 2.0))
            .state("x", "m")
            .input("u", "m/s")
            .output("now", "m")
            .output("later", "m");
        (0..self.register).fold(outline, |outline, i| {
            outline.state(&format!("past{i}"), "m")
        })
    }
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        dx.fill(0.0);
        dx[0] = now.u[0] - now.theta[0] * x[0];
    }
    fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
        y.copy_from_slice(&[x[0], x[self.register]]);
    }
    fn start(&self, _: &Now<'_>, x: &mut [f64]) {
        x.fill(1.0);
    }
    fn start_deviation(&self, _: &Now<'_>, std: &mut [f64]) {
        std[0] = 0.5;
    }
    fn begin(&self, _: &Now<'_>, x: &mut [f64]) {
        let first = x[0];
        x.fill(first);
    }
    fn noise(&self, _: &Now<'_>, process: &mut [f64], measurement: &mut [f64]) {
        process[0] = 0.3;
        measurement.copy_from_slice(&[0.4, 0.1]);
    }
    fn update(&self, _: &Now<'_>, x: &mut [f64]) {
        x.rotate_right(1);
        x[0] = x[usize::from(self.register > 0)];
    }
    fn dead_time(&self, _: &[f64], _: f64) -> Vec<usize> {
        match self.register {
            0 => vec![0, LATE],
            _ => vec![],
        }
    }
}

const DEAD_TIME: Leak = Leak { register: 0 };
const REGISTER: Leak = Leak { register: LATE };

fn record(seed: u64) -> Record {
    let inputs = Signal::from_shape_fn((90, 1), |(k, _)| (0.3 * k as f64).sin());
    let drive = Drive::new(0.2, inputs).unwrap();
    let outputs = DEAD_TIME.simulate(&[0.7], &drive, Noise::new(seed, "late", 0));
    Record::new(drive, outputs.unwrap()).unwrap()
}

fn with<T>(twin: &Leak, record: &Record, then: impl FnOnce(&Kalman<'_>) -> T) -> T {
    let settings = FilterSettings::default();
    then(&Kalman::new(twin, record, &settings).unwrap())
}

/// A linear twin: both filters are exact, so that all values together have one density, the first ones and missing ones included.
#[test]
fn a_dead_time_is_a_register_of_states() {
    let whole = record(1);
    let run = |twin: &Leak| twin.free_run(&[0.7], whole.drive()).unwrap();
    assert_eq!(run(&DEAD_TIME), run(&REGISTER));
    let mut outputs = whole.outputs().clone();
    for (k, j) in [(2, 1), (40, 0), (41, 0), (41, 1), (88, 1)] {
        outputs[[k, j]] = f64::NAN;
    }
    let gappy = Record::new(whole.drive().clone(), outputs).unwrap();
    for record in [&whole, &gappy] {
        for theta in [[0.7], [1.1]] {
            let expected = with(&REGISTER, record, |k| k.filter(&theta).unwrap());
            let found = with(&DEAD_TIME, record, |k| k.filter(&theta).unwrap());
            let error = found.log_likelihood - expected.log_likelihood;
            assert!(error.abs() < 1e-8, "{error}");
            let sum: f64 = found.log_densities.iter().sum();
            assert!((sum - found.log_likelihood).abs() < 1e-8);
            for (cell, y) in record.outputs().indexed_iter() {
                assert_eq!(y.is_nan(), found.innovations[cell] == 0.0, "{cell:?}");
            }
        }
        let score = |twin: &Leak| {
            with(twin, record, |k| {
                Score::forward(k, &[0.9], &Coordinates::new(k.parameters())).unwrap()
            })
        };
        let (own, register) = (score(&DEAD_TIME), score(&REGISTER));
        let error = own.gradient[0] - register.gradient[0];
        assert!(
            error.abs() < 1e-3 * register.fisher[(0, 0)].sqrt(),
            "{error}"
        );
    }
}

/// A prediction knows nothing of its own row and later ones. It is not much worse than one from all rows before; of an
/// output as late and as precise as this one, beside much process noise, it misses what the other has shown since.
#[test]
fn predictions_do_not_see_the_future() {
    let whole = record(2);
    let all = with(&DEAD_TIME, &whole, |k| k.predictions(&[0.7]).unwrap());
    for from in [0, 3, LATE, 20, 60, 88] {
        let mut outputs = whole.outputs().clone();
        outputs
            .slice_mut(ndarray::s![from.., ..])
            .mapv_inplace(|y| y + 5.0);
        let other = Record::new(whole.drive().clone(), outputs).unwrap();
        let other = with(&DEAD_TIME, &other, |k| k.predictions(&[0.7]).unwrap());
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
    let best = error(&with(&REGISTER, &whole, |k| k.predictions(&[0.7]).unwrap()));
    for ((own, best), most) in own.iter().zip(best).zip([1.3, 2.0]) {
        assert!((0.95..most).contains(&(own / best)), "{own} of {best}");
    }
}
