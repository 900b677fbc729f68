//! Linear twins with normal noise, for which the filter is exact.

use super::{Coordinates, FilterError, FilterSettings, Kalman, Method, Score};
use crate::record::*;
use crate::twin::*;
use nalgebra::{DMatrix, DVector, dmatrix, dvector};

/// Two coupled masses pushed by u; with one output, or the second state and the sum too.
#[derive(Clone)]
struct Chain {
    outputs: usize,
    ceiling: f64,
}

const DT: f64 = 0.1;
const Q: [f64; 2] = [0.0, 0.3];
const R: [f64; 2] = [0.2, 0.1];

impl Chain {
    fn new(outputs: usize) -> Self {
        Self {
            outputs,
            ceiling: f64::INFINITY,
        }
    }

    fn c(&self) -> DMatrix<f64> {
        dmatrix![1.0, 0.0; 0.5, 2.0]
            .rows(0, self.outputs)
            .into_owned()
    }
}

impl StateSpace for Chain {
    fn outline(&self) -> Outline {
        let outputs = (1..=self.outputs).map(|j| Quantity::new(&format!("y{j}"), "m"));
        Outline {
            parameters: ParameterSpace::new([
                Parameter::new("k", "1/s²", 0.5, 2.0),
                Parameter::new("offset", "m/s²", -1.0, 1.0),
            ]),
            states: vec![Quantity::new("x", "m"), Quantity::new("v", "m/s")],
            inputs: vec![Quantity::new("u", "m/s²")],
            outputs: outputs.collect(),
            ..Outline::new()
        }
    }
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        dx[0] = x[1];
        dx[1] = now.u[0] + now.theta[1] - now.theta[0] * x[0] - 0.4 * x[1];
    }
    fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
        let c = self.c() * DVector::from_column_slice(x);
        y.copy_from_slice(c.as_slice());
    }
    fn start(&self, _: &Now<'_>, x: &mut [f64]) {
        x.copy_from_slice(&[1.0, -0.5]);
    }
    fn noise(&self, now: &Now<'_>, _: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        process.copy_from_slice(&Q.map(|q| q * (now.dt / DT).sqrt()));
        measurement.copy_from_slice(&R[..self.outputs]);
    }
    fn readout(&self, _: &Now<'_>, y: &mut [f64]) {
        y[0] = y[0].min(self.ceiling);
    }
}

fn record(twin: &Chain, theta: &[f64]) -> Record {
    let inputs = Signal::from_shape_fn((120, 1), |(k, _)| (0.2 * k as f64).sin());
    let drive = Drive::new(DT, inputs).unwrap();
    let outputs = (twin.simulate(theta, &drive, Noise::new(3, "linear", 0))).unwrap();
    Record::new(drive, outputs).unwrap()
}

struct Exact {
    log_likelihood: f64,
    filtered: Vec<(DVector<f64>, DMatrix<f64>)>,
    smoothed: Vec<(DVector<f64>, DMatrix<f64>)>,
}

/// The textbook's recursions, with matrices written out; of each row the outputs that are there.
fn exact(twin: &Chain, theta: &[f64], record: &Record, start: &DMatrix<f64>) -> Exact {
    let carry = |dt: f64| dmatrix![1.0, dt; -dt * theta[0], 1.0 - 0.4 * dt];
    let (mut m, mut p) = (dvector![1.0, -0.5], start.clone());
    let mut log_likelihood = 0.0;
    let (mut filtered, mut predicted) = (vec![], vec![(m.clone(), p.clone())]);
    for k in 0..record.samples() {
        let y = record.outputs().row(k).to_vec();
        let there: Vec<usize> = (0..y.len()).filter(|&j| !y[j].is_nan()).collect();
        let c = twin.c().select_rows(&there);
        let r = DVector::from_iterator(there.len(), there.iter().map(|&j| R[j] * R[j]));
        let r = DMatrix::from_diagonal(&r);
        let y = DVector::from_iterator(there.len(), there.iter().map(|&j| y[j]));
        let e = y - &c * &m;
        let s = &c * &p * c.transpose() + &r;
        let inverse = s.clone().try_inverse().unwrap();
        log_likelihood -=
            0.5 * ((s * 2.0 * std::f64::consts::PI).determinant().ln() + e.dot(&(&inverse * &e)));
        let gain = &p * c.transpose() * inverse;
        m += &gain * e;
        p = &p - &gain * &c * &p;
        filtered.push((m.clone(), p.clone()));
        let dt = record.drive().step(k);
        let q = DMatrix::from_diagonal(&dvector![Q[0], Q[1]].map(|v| v * v * dt / DT));
        let (a, push) = (carry(dt), dt * (record.drive().input(k)[0] + theta[1]));
        m = &a * m + dvector![0.0, push];
        p = &a * p * a.transpose() + &q;
        predicted.push((m.clone(), p.clone()));
    }
    let mut smoothed = filtered.clone();
    for k in (0..record.samples() - 1).rev() {
        let (m, p) = &filtered[k];
        let (ahead, spread) = &predicted[k + 1];
        let a = carry(record.drive().step(k));
        let gain = p * a.transpose() * spread.clone().try_inverse().unwrap();
        let (later, sure) = smoothed[k + 1].clone();
        smoothed[k] = (
            m + &gain * (later - ahead),
            p + &gain * (sure - spread) * gain.transpose(),
        );
    }
    Exact {
        log_likelihood,
        filtered,
        smoothed,
    }
}

const METHODS: [Method; 2] = [Method::Points, Method::Extended];

/// Holds filter and smoother against the exact ones, from starts that are known and not, with both methods.
fn agrees_with_the_exact_filter(twin: &Chain, record: &Record) {
    let theta = [1.2, 0.3];
    // Invertible, so that the textbook's smoother has its inverse.
    for start in [dmatrix![1e-6, 0.0; 0.0, 1e-6], dmatrix![0.5, 0.2; 0.2, 0.4]] {
        let expected = exact(twin, &theta, record, &start);
        for method in METHODS {
            let settings = FilterSettings {
                method,
                start_covariance: Some(start.clone()),
                keep_states: true,
                ..FilterSettings::default()
            };
            let found = Kalman::new(twin.clone(), record, &settings)
                .and_then(|k| k.filter(&theta))
                .unwrap();
            let error = found.log_likelihood - expected.log_likelihood;
            assert!(error.abs() < 1e-8, "{method:?}: {error}");
            let sum: f64 = found.log_densities.iter().sum();
            assert!((sum - found.log_likelihood).abs() < 1e-9);
            let fast = Kalman::new(twin.clone(), record, &settings)
                .and_then(|k| k.log_likelihood(&theta))
                .unwrap();
            assert_eq!(fast, found.log_likelihood);
            for (cell, y) in record.outputs().indexed_iter().filter(|(_, y)| y.is_nan()) {
                assert_eq!(
                    (found.innovations[cell], found.standardised[cell]),
                    (0.0, 0.0),
                    "{y}"
                );
            }
            let smoothed = Kalman::new(twin.clone(), record, &settings)
                .and_then(|k| k.smooth(&theta))
                .unwrap();
            let first = Kalman::new(twin.clone(), record, &settings)
                .and_then(|k| k.first_state(&theta))
                .unwrap();
            let (mean, covariance) = &expected.smoothed[0];
            for i in 0..2 {
                assert!((first.mean[i] - mean[i]).abs() < 1e-8);
                for j in 0..2 {
                    assert!((first.cov[2 * i + j] - covariance[(i, j)]).abs() < 1e-8);
                }
            }
            for (states, expected) in [
                (found.states.unwrap(), &expected.filtered),
                (smoothed, &expected.smoothed),
            ] {
                for (k, (m, p)) in expected.iter().enumerate() {
                    for i in 0..2 {
                        assert!((states.means[[k, i]] - m[i]).abs() < 1e-8);
                        for j in 0..2 {
                            let error = states.covariances[[k, i, j]] - p[(i, j)];
                            assert!(error.abs() < 1e-8, "{method:?}, row {k}: {error}");
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn linear_twins_are_filtered_and_smoothed_exactly() {
    for outputs in [1, 2] {
        let twin = Chain::new(outputs);
        agrees_with_the_exact_filter(&twin, &record(&twin, &[1.2, 0.3]));
    }
}

/// Empties each cell with probability `share`.
fn with_gaps(record: &Record, share: f64) -> Record {
    let mut source = Noise::new(7, "gaps", 0).source("cells");
    let outputs = record.outputs().mapv(|y| match source.uniform() < share {
        true => f64::NAN,
        false => y,
    });
    Record::new(record.drive().clone(), outputs).unwrap()
}

/// Steps between a quarter and three times the usual one.
fn with_steps(twin: &Chain, record: &Record) -> Record {
    let mut source = Noise::new(8, "steps", 0).source("steps");
    let mut times = vec![0.0];
    for k in 1..record.samples() {
        times.push(times[k - 1] + DT * (0.25 + 2.75 * source.uniform()));
    }
    let drive = Drive::with_times(&times, record.drive().inputs().clone()).unwrap();
    assert!(!drive.is_uniform());
    let outputs = twin.simulate(&[1.2, 0.3], &drive, Noise::new(3, "linear", 0));
    Record::new(drive, outputs.unwrap()).unwrap()
}

/// One cell in ten missing: in two outputs alone and together.
#[test]
fn missing_outputs_are_left_out_exactly() {
    for outputs in [1, 2] {
        let twin = Chain::new(outputs);
        let some = with_gaps(&record(&twin, &[1.2, 0.3]), 0.1);
        assert!((5..40).contains(&some.missing()), "{}", some.missing());
        agrees_with_the_exact_filter(&twin, &some);
        // More than half missing: rows without any output among them.
        let few = with_gaps(&record(&twin, &[1.2, 0.3]), 0.6);
        agrees_with_the_exact_filter(&twin, &few);
    }
}

#[test]
fn varying_steps_are_filtered_exactly() {
    for outputs in [1, 2] {
        let twin = Chain::new(outputs);
        let uneven = with_steps(&twin, &record(&twin, &[1.2, 0.3]));
        agrees_with_the_exact_filter(&twin, &uneven);
        agrees_with_the_exact_filter(&twin, &with_gaps(&uneven, 0.1));
    }
}

/// Rows without an output have no part in the score, and the score stays the derivative.
#[test]
fn a_missing_output_has_no_score() {
    for outputs in [1, 2] {
        let twin = Chain::new(outputs);
        let record = with_gaps(&with_steps(&twin, &record(&twin, &[1.2, 0.3])), 0.5);
        let settings = FilterSettings::default();
        let kalman = Kalman::new(twin.clone(), &record, &settings).unwrap();
        let score = Score::at(&kalman, &[1.2, 0.3]).unwrap();
        let empty = |k: usize| record.outputs().row(k).iter().all(|y| y.is_nan());
        assert!((0..record.samples()).any(empty));
        let known = DMatrix::identity(2, 2) * 1e-18;
        let value = |c: f64| exact(&twin, &[1.2, c], &record, &known).log_likelihood;
        let h = 1e-5;
        let expected = (value(0.3 + h) - value(0.3 - h)) / (2.0 * h);
        let (error, scale) = (score.gradient[1] - expected, score.fisher[(1, 1)].sqrt());
        assert!(error.abs() < 1e-3 * scale, "{error} of {scale}");
        assert!(scale.is_finite());
    }
}

/// With a known start the first prediction is certain but for the sensor.
#[test]
fn a_known_start_leaves_the_measurement_noise() {
    let twin = Chain::new(2);
    let record = record(&twin, &[1.0, 0.0]);
    let found = Kalman::new(twin.clone(), &record, &FilterSettings::default())
        .and_then(|k| k.filter(&[1.0, 0.0]))
        .unwrap();
    let variances = found.variances();
    for j in 0..2 {
        assert!((variances[[0, j]] - R[j] * R[j]).abs() < 1e-14);
        let z = found.innovations[[0, j]] / R[j];
        assert!((found.standardised[[0, j]] - z).abs() < 1e-12);
    }
    let predictions = found.predictions(record.outputs());
    assert!((predictions[[0, 1]] - (0.5 - 1.0)).abs() < 1e-12);
}

/// The score is the derivative of the exact log-likelihood, in log k and in the offset; at a bound it is one-sided.
#[test]
fn the_score_is_the_derivative_of_the_log_likelihood() {
    let twin = Chain::new(1);
    let record = record(&twin, &[1.2, 0.3]);
    let settings = FilterSettings::default();
    let kalman = Kalman::new(twin.clone(), &record, &settings).unwrap();
    let known = DMatrix::zeros(2, 2);
    let value = |k: f64, offset: f64| {
        let a = exact_likelihood(&twin, &[k, offset], &record, &known);
        assert!(a.is_finite());
        a
    };
    for theta in [[1.2, 0.3], [2.0, -1.0]] {
        let score = Score::at(&kalman, &theta).unwrap();
        let h = 1e-5;
        let [k, c] = theta;
        let expected = [
            (value(k * f64::exp(h), c) - value(k * f64::exp(-h), c)) / (2.0 * h),
            (value(k, c + h) - value(k, c - h)) / (2.0 * h),
        ];
        for (j, expected) in expected.iter().enumerate() {
            let error = (score.gradient[j] - expected).abs();
            let scale = score.fisher[(j, j)].sqrt();
            assert!(error < 1e-3 * scale, "{j}: {error} of {scale}");
        }
        let fast = kalman.log_likelihood(&theta).unwrap();
        assert_eq!(score.log_likelihood, fast);
    }
    assert!(matches!(
        Score::at(&kalman, &[3.0, 0.0]),
        Err(FilterError::Parameter(_))
    ));
}

fn exact_likelihood(twin: &Chain, theta: &[f64], record: &Record, start: &DMatrix<f64>) -> f64 {
    // A start known to 1e-9: the textbook's form takes it.
    let start = start + DMatrix::identity(2, 2) * 1e-18;
    let a = dmatrix![1.0, DT; -DT * theta[0], 1.0 - 0.4 * DT];
    let (c, r) = (twin.c(), R[0] * R[0]);
    let q = DMatrix::from_diagonal(&dvector![Q[0], Q[1]].map(|v| v * v));
    let (mut m, mut p, mut sum) = (dvector![1.0, -0.5], start, 0.0);
    for k in 0..record.samples() {
        let e = record.outputs()[[k, 0]] - (&c * &m)[0];
        let s = (&c * &p * c.transpose())[0] + r;
        sum -= 0.5 * ((2.0 * std::f64::consts::PI * s).ln() + e * e / s);
        let gain = &p * c.transpose() / s;
        m += &gain * e;
        p = &p - &gain * &c * &p;
        m = &a * m + dvector![0.0, DT * (record.drive().input(k)[0] + theta[1])];
        p = &a * p * a.transpose() + &q;
    }
    sum
}

/// Over records, the score's covariance and the expected information agree; also with two outputs.
#[test]
fn information_is_the_covariance_of_the_score() {
    let theta = [1.2, 0.3];
    for outputs in [1, 2] {
        let twin = Chain::new(outputs);
        let settings = FilterSettings::default();
        let n = 400u32;
        let [mut fisher, mut squares] = [(); 2].map(|()| DMatrix::<f64>::zeros(2, 2));
        for run in 0..n {
            let drive = record(&twin, &theta).drive().clone();
            let noise = Noise::new(4, "information", run.into());
            let outputs = twin.simulate(&theta, &drive, noise).unwrap();
            let record = Record::new(drive, outputs).unwrap();
            let kalman = Kalman::new(twin.clone(), &record, &settings).unwrap();
            let score = Score::at(&kalman, &theta).unwrap();
            fisher += &score.fisher / f64::from(n);
            squares += &score.gradient * score.gradient.transpose() / f64::from(n);
        }
        for j in 0..2 {
            // Relative sd of a mean of n squares: √(2/n) = 0.07.
            let ratio = squares[(j, j)] / fisher[(j, j)];
            assert!((ratio - 1.0).abs() < 0.3, "{squares} {fisher}");
        }
    }
}

/// A sensor that never saturates changes no bit; one that does is believed less, and the filter stays calibrated
/// enough to prefer the twin that knows of it.
#[test]
fn a_saturating_sensor_is_known_to_saturate() {
    let theta = [1.2, 0.3];
    let record = record(
        &Chain {
            outputs: 1,
            ceiling: 0.4,
        },
        &theta,
    );
    let settings = FilterSettings::default();
    let of = |ceiling| {
        let twin = Chain {
            outputs: 1,
            ceiling,
        };
        Kalman::new(twin.clone(), &record, &settings)
            .and_then(|k| k.log_likelihood(&theta))
            .unwrap()
    };
    assert_eq!(of(1e9), of(f64::INFINITY));
    assert!(
        of(0.4) > of(f64::INFINITY) + 10.0,
        "{} {}",
        of(0.4),
        of(f64::INFINITY)
    );
}

#[test]
fn what_does_not_fit_is_named() {
    let twin = Chain::new(1);
    let theta = [1.2, 0.3];
    let fitting = record(&twin, &theta);
    let settings = FilterSettings::default();
    let short = Kalman::new(twin.clone(), &fitting, &settings)
        .and_then(|k| k.log_likelihood(&[1.0]))
        .unwrap_err();
    assert!(
        short.to_string().contains("1 value for 2 parameters"),
        "{short}"
    );
    let other = Chain::new(2);
    let error = Kalman::new(other, &fitting, &settings)
        .and_then(|k| k.log_likelihood(&theta))
        .unwrap_err();
    assert!(
        error.to_string().contains("1 output, the twin has 2"),
        "{error}"
    );
    let error = Kalman::new(twin.clone(), &fitting, &settings)
        .and_then(|k| k.log_likelihood(&[1e200, 0.0]))
        .unwrap_err();
    assert!(error.is_recoverable(), "{error}");
}

/// A clock whose phase is read over sixty periods, by equations that are exact to a millionth: its frequency is told to the half step of a one-sided
/// difference, which must not move the top.
#[test]
fn one_sided_scores_vanish_at_a_sharp_top() {
    #[derive(Clone)]
    struct Clock;
    impl StateSpace for Clock {
        fn outline(&self) -> Outline {
            Outline {
                parameters: ParameterSpace::new([
                    Parameter::new("w", "rad/s", 5.0, 20.0),
                    Parameter::new("decay", "1/s", 0.001, 0.1),
                ]),
                states: vec![Quantity::new("x", "m"), Quantity::new("v", "m/s")],
                outputs: vec![Quantity::new("y", "m")],
                ..Outline::new()
            }
        }
        fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
            let [w, decay] = [now.theta[0], now.theta[1]];
            (dx[0], dx[1]) = (x[1], -w * w * x[0] - decay * x[1]);
        }
        fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
            y[0] = x[0];
        }
        fn start(&self, _: &Now<'_>, x: &mut [f64]) {
            x.copy_from_slice(&[1.0, 0.0]);
        }
        fn noise(&self, _: &Now<'_>, _: &[f64], _: &mut [f64], measurement: &mut [f64]) {
            measurement[0] = 0.01;
        }
        fn integrator(&self) -> Integrator {
            Integrator::RungeKutta4
        }
        fn stepping(&self) -> Stepping {
            Stepping {
                substeps: 8,
                ..Stepping::default()
            }
        }
    }
    let theta = [10.0, 0.01];
    let drive = Drive::autonomous(0.1, 400).unwrap();
    let outputs = Clock
        .simulate(&theta, &drive, Noise::new(1, "clock", 0))
        .unwrap();
    let record = Record::new(drive, outputs).unwrap();
    let settings = FilterSettings::default();
    let kalman = Kalman::new(Clock, &record, &settings).unwrap();
    let coordinates = Coordinates::new(kalman.parameters());
    let log_likelihood = |h: f64| {
        let there = [theta[0] * h.exp(), theta[1]];
        kalman.log_likelihood(&there).unwrap()
    };
    let slope = (log_likelihood(1e-7) - log_likelihood(-1e-7)) / 2e-7;
    let lanes = Score::forward(&kalman, &theta, &coordinates).unwrap();
    let scalar = Score::forward_one_by_one(&kalman, &theta, &coordinates).unwrap();
    for score in [&lanes, &scalar] {
        let deviations = (score.gradient[0] - slope) / score.fisher[(0, 0)].sqrt();
        assert!(deviations.abs() < 0.1, "{deviations}");
    }
    // A half step is most of a deviation here.
    assert!(0.5e-5 * scalar.fisher[(0, 0)].sqrt() > 0.5);
}
