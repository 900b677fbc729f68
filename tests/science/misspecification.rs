//! The autoregressive series of Covington and Miller, "Bayesian model criticism using uniform parametrization checks" (2025): how often a
//! departure is called, by `diagnose`, by the gates of `estimate`, and by the authors' own check, on the same series.
//!
//! ```text
//! model      Y₁ ~ N(0, σ²), Yᵢ ~ N(φ·Yᵢ₋₁, σ²), n = 200
//!            φ ~ N(0, 0.4²) in [−0.5, 0.5], σ ~ N(1.5, 0.4²) in [1, 2]
//! AR(2)      mean φ·Yᵢ₋₁ + s·sign(φ)·|φ|^¼·Yᵢ₋₂
//! spread     standard deviation σ·(1 + s·(2i − n − 1)/n)
//! ```

use crate::binomial_bounds;
use statrs::distribution::{ContinuousCDF, Normal};
use std::array;
use truetwin::diagnose::{DiagnoseSettings, Verdict, diagnose};
use truetwin::estimator::{EstimateOptions, Estimator, PretrainOptions, pretrain};
use truetwin::prelude::*;
use truetwin::study::StudyFile;

const SAMPLES: usize = 200;
/// Null draws of the authors' check.
const NULL: u64 = 2000;
const CHECKS: [&str; 4] = [
    "diagnose",
    "gate, network",
    "gate, refit",
    "uniform parametrization",
];

/// xₖ₊₁ = φ·xₖ + w: an Euler step of one second.
struct Autoregressive;
impl StateSpace for Autoregressive {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("phi", "1", -0.5, 0.5).within(-0.99, 0.99))
            .state("x", "1")
            .output("y", "1")
    }
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        dx[0] = (now.theta[0] - 1.0) * x[0];
    }
    fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }
    fn noise(&self, _: &Now<'_>, _: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        (process[0], measurement[0]) = (1.5, 0.02);
    }
}

fn study() -> Study {
    let study = Study::new("ar", Autoregressive, RecordPlan::autonomous(1.0, SAMPLES)).unwrap();
    let text = "twin = 'ar'\n[start]\nx = { mean = 0.0, std = 1.5 }";
    let file = StudyFile::parse(text, "ar.toml".as_ref()).unwrap();
    study.configure(&file).unwrap()
}

#[derive(Debug, Clone, Copy)]
enum Departure {
    Second,
    Spread,
    /// None: σ is off the declared level by this share, which the model allows.
    Level,
}

/// A series of the model, φ and σ from the prior, with a departure of this strength.
fn series(departure: Departure, strength: f64, noise: Noise) -> Vec<f64> {
    let mut source = noise.source("series");
    let within = |centre: f64, half: f64, draw: &mut dyn FnMut() -> f64| {
        std::iter::repeat_with(|| centre + 0.4 * draw())
            .find(|v| (v - centre).abs() <= half)
            .unwrap()
    };
    let phi = within(0.0, 0.5, &mut || source.normal());
    let mut sigma = within(1.5, 0.5, &mut || source.normal());
    if matches!(departure, Departure::Level) {
        sigma = 1.5 * (1.0 + strength);
    }
    let mut y: Vec<f64> = vec![];
    for i in 0..SAMPLES {
        let before = |lag: usize| i.checked_sub(lag).map_or(0.0, |at| y[at]);
        let (mut mean, mut spread) = (phi * before(1), sigma);
        match departure {
            Departure::Second => {
                mean += strength * phi.signum() * phi.abs().powf(0.25) * before(2);
            }
            Departure::Spread => {
                let n = SAMPLES as f64;
                spread *= 1.0 + strength * (2.0 * (i + 1) as f64 - n - 1.0) / n;
            }
            Departure::Level => {}
        }
        y.push(mean + spread * source.normal());
    }
    y
}

fn record(y: &[f64]) -> Record {
    let outputs = Signal::from_shape_fn((SAMPLES, 1), |(k, _)| y[k]);
    Record::new(Drive::autonomous(1.0, SAMPLES).unwrap(), outputs).unwrap()
}

/// Hoeffding's D of pairs without ties.
fn hoeffding(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len() as f64;
    let (mut d1, mut d2, mut d3) = (0.0, 0.0, 0.0);
    for a in pairs {
        let count =
            |below: &dyn Fn(&(f64, f64)) -> bool| pairs.iter().filter(|b| below(b)).count() as f64;
        let (r, s) = (count(&|b| b.0 < a.0), count(&|b| b.1 < a.1));
        let q = count(&|b| b.0 < a.0 && b.1 < a.1);
        d1 += q * (q - 1.0);
        d2 += r * (r - 1.0) * s * (s - 1.0);
        d3 += (r - 1.0) * (s - 1.0) * q;
    }
    let scale: f64 = (0..5).map(|k| n - f64::from(k)).product();
    30.0 * ((n - 2.0) * (n - 3.0) * d1 + d2 - 2.0 * (n - 2.0) * d3) / scale
}

/// D of independent pairs, sorted.
fn independent(pairs: usize) -> Vec<f64> {
    let mut all: Vec<f64> = (0..NULL)
        .map(|sample| {
            let mut source = Noise::new(1, "null", sample).source("pairs");
            let pairs: Vec<_> = (0..pairs)
                .map(|_| (source.uniform(), source.uniform()))
                .collect();
            hoeffding(&pairs)
        })
        .collect();
    all.sort_by(f64::total_cmp);
    all
}

/// One draw of (φ, σ) from the model's posterior, on a grid.
fn drawn(y: &[f64], noise: Noise) -> (f64, f64) {
    const CELLS: usize = 200;
    let lagged: f64 = y.windows(2).map(|w| w[0] * w[1]).sum();
    let before: f64 = y[..y.len() - 1].iter().map(|v| v * v).sum();
    let after: f64 = y[1..].iter().map(|v| v * v).sum();
    let at = |i: usize| {
        let cell = |low: f64, k: usize| low + (k as f64 + 0.5) / CELLS as f64;
        (cell(-0.5, i / CELLS), cell(1.0, i % CELLS))
    };
    let log: Vec<f64> = (0..CELLS * CELLS)
        .map(|i| {
            let (phi, sigma) = at(i);
            let squares = after - 2.0 * phi * lagged + phi * phi * before;
            let prior = (phi / 0.4).powi(2) + ((sigma - 1.5) / 0.4).powi(2);
            -0.5 * (squares / sigma.powi(2) + prior) - (y.len() - 1) as f64 * sigma.ln()
        })
        .collect();
    let top = log.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let total: f64 = log.iter().map(|l| (l - top).exp()).sum();
    let mut left = total * noise.source("posterior").uniform();
    let chosen = log.iter().position(|l| {
        left -= (l - top).exp();
        left <= 0.0
    });
    at(chosen.unwrap_or(log.len() - 1))
}

/// The series under the four checks of [`CHECKS`].
struct Checks {
    study: Study,
    estimator: Estimator,
    null: Vec<f64>,
}

impl Checks {
    fn new() -> Self {
        let study = study();
        let options = PretrainOptions {
            bank_size: Some(2000),
            epochs: Some(30),
            seed: 1,
            ..PretrainOptions::default()
        };
        let estimator = pretrain(study.clone(), &options, &Progress::silent());
        Self {
            estimator: estimator.unwrap().0,
            study,
            null: independent(SAMPLES - 2),
        }
    }

    /// Returns whether each check calls the series, at a level of 5 %. Without an input a second lag is correlated noise by another name, so that
    /// for `diagnose` noise of another kind than the twin's counts as well.
    fn call(&self, y: &[f64], departure: Departure, noise: Noise) -> [bool; 4] {
        let [network, refit] = self.gates_call(y);
        let authors = self.authors_call(y, departure, noise);
        [self.diagnosis_calls(y), network, refit, authors]
    }

    fn diagnosis_calls(&self, y: &[f64]) -> bool {
        let settings = DiagnoseSettings {
            detection_only: true,
            ..DiagnoseSettings::default()
        };
        let records = [record(y)];
        let found = diagnose(&self.study, &records, None, &settings, &Progress::silent()).unwrap();
        found.verdict == Verdict::StructuralGap
            || !(found.correlated_noise.is_empty() && found.outliers.is_empty())
    }

    /// The gate of the network's estimate, and the one after a refit.
    fn gates_call(&self, y: &[f64]) -> [bool; 2] {
        let options = EstimateOptions::default();
        let estimate = (self.estimator).estimate_with(&record(y), &options, &Progress::silent());
        let estimate = estimate.unwrap();
        [
            estimate.gate.p_value <= 0.05,
            estimate.after().is_some_and(|gate| gate.p_value <= 0.05),
        ]
    }

    /// The authors' check: residuals of one posterior draw, as uniform numbers, against their time or their second predecessors.
    fn authors_call(&self, y: &[f64], departure: Departure, noise: Noise) -> bool {
        let (phi, sigma) = drawn(y, noise);
        let normal = Normal::standard();
        let u: Vec<f64> = (0..y.len())
            .map(|i| normal.cdf((y[i] - i.checked_sub(1).map_or(0.0, |j| phi * y[j])) / sigma))
            .collect();
        let pairs: Vec<_> = match departure {
            Departure::Second | Departure::Level => u.windows(3).map(|w| (w[0], w[2])).collect(),
            Departure::Spread => u[2..]
                .iter()
                .enumerate()
                .map(|(i, u)| (i as f64, *u))
                .collect(),
        };
        let d = hoeffding(&pairs);
        let above = self.null.len() - self.null.partition_point(|v| *v < d);
        (1 + above) as f64 / (1 + self.null.len()) as f64 <= 0.05
    }

    /// Series that each check calls, of `trials`.
    fn calls(&self, departure: Departure, strength: f64, trials: u64) -> [u64; 4] {
        let mut calls = [0; 4];
        for trial in 0..trials {
            let (y, noise) = trial_series(departure, strength, trial);
            let called = self.call(&y, departure, noise);
            calls = array::from_fn(|i| calls[i] + u64::from(called[i]));
        }
        println!("| {departure:?} | {strength} | {calls:?} of {trials} |");
        calls
    }
}

/// A series of the test's, with its noise.
fn trial_series(departure: Departure, strength: f64, trial: u64) -> (Vec<f64>, Noise) {
    let noise = Noise::new(1168, &format!("{departure:?} {strength}"), trial);
    (series(departure, strength, noise), noise)
}

/// A clear second lag is called by the authors' check, and by `diagnose` in half of six series: at the level, three have a chance of 1 in 400.
/// Noise 18 % above the declared level is none of a gate's business: gates in the declared one, which call 7 and 9 of twelve series, call
/// at most 2 of 7 with chances of 1 in 9 and 1 in 78.
#[test]
fn a_second_lag_is_called_and_a_level_of_noise_is_not() {
    let checks = Checks::new();
    let (mut diagnosed, mut authors) = (0, 0);
    for trial in 0..6 {
        let (y, noise) = trial_series(Departure::Second, 0.8, trial);
        diagnosed += u64::from(checks.diagnosis_calls(&y));
        authors += u64::from(checks.authors_call(&y, Departure::Second, noise));
    }
    assert!(diagnosed >= 3 && authors >= 5, "{diagnosed} and {authors}");
    let (mut network, mut refit) = (0, 0);
    for trial in 0..7 {
        let called = checks.gates_call(&trial_series(Departure::Level, 0.18, trial).0);
        network += u64::from(called[0]);
        refit += u64::from(called[1]);
    }
    assert!(network <= 2 && refit <= 2, "{network} and {refit}");
}

#[test]
#[ignore = "minutes; the table of docs/benchmarks.md; run it in release"]
fn power_on_autoregressive_series() {
    println!("{CHECKS:?}");
    let checks = Checks::new();
    let called = checks.calls(Departure::Second, 0.0, 100);
    let bound = *binomial_bounds(100, 0.05, 0.999).end();
    assert!(called.iter().all(|called| *called <= bound), "{called:?}");
    for departure in [Departure::Second, Departure::Spread] {
        for strength in [0.2, 0.4, 0.6, 0.8] {
            checks.calls(departure, strength, 50);
        }
    }
}
