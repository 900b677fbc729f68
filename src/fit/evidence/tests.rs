//! Evidence against closed forms and quadrature.

use super::expansion::Expansion;
use super::*;
use crate::fit::axis::Axis;
use crate::fit::axis::EvidencePrior;
use crate::fit::climb::climb;
use crate::fit::posterior::{DrawsAsked, PosteriorSample, posterior};
use crate::math::log_mean;
use crate::record::{Drive, Record, Signal};
use crate::twin::{Now, Outline, Parameter, StateSpace, Twin};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// y = a + b·u, a and b unknown, unit noise: everything is normal, and Z is known in closed form.
struct Line;
impl StateSpace for Line {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("a", "", -3.0, 3.0).within(-50.0, 50.0))
            .parameter(Parameter::new("b", "", -3.0, 3.0).within(-50.0, 50.0))
            .state("x", "")
            .input("u", "")
            .output("y", "")
    }
    fn drift(&self, _: &Now<'_>, _: &[f64], dx: &mut [f64]) {
        dx[0] = 0.0;
    }
    fn observe(&self, now: &Now<'_>, _: &[f64], y: &mut [f64]) {
        y[0] = now.theta[0] + now.theta[1] * now.u[0];
    }
    fn noise(&self, _: &Now<'_>, _: &[f64], _: &mut [f64], measurement: &mut [f64]) {
        measurement[0] = 1.0;
    }
}

fn record(n: usize) -> Record {
    let u = Signal::from_shape_fn((n, 1), |(k, _)| (k as f64 * 0.7).sin());
    let y = Signal::from_shape_fn((n, 1), |(k, _)| {
        0.4 + 1.3 * u[[k, 0]] + (k as f64 * 12.9).sin() * 1.2
    });
    Record::new(Drive::new(1.0, u).unwrap(), y).unwrap()
}

/// log N(y; 0, I + X·P⁻¹·Xᵀ) with prior variances `v`.
fn exact(record: &Record, v: [f64; 2]) -> f64 {
    let n = record.samples();
    let x = DMatrix::from_fn(n, 2, |k, j| {
        if j == 0 {
            1.0
        } else {
            record.drive().input(k)[0]
        }
    });
    let y = DVector::from_iterator(n, record.outputs().column(0).iter().copied());
    let covariance = DMatrix::identity(n, n)
        + &x * DMatrix::from_diagonal(&DVector::from_row_slice(&v)) * x.transpose();
    let factor = covariance.cholesky().unwrap();
    let log_determinant: f64 = (0..n).map(|i| 2.0 * factor.l()[(i, i)].ln()).sum();
    -0.5 * (n as f64 * TAU.ln() + log_determinant + y.dot(&factor.solve(&y)))
}

fn problem(records: &[Record], size: Option<f64>) -> Problem {
    let twin = Twin::new(Line);
    let space = twin.parameters();
    let mut axes: Vec<Axis> = space.iter().map(Axis::of).collect();
    if let Some(largest) = size {
        axes[1].evidence = EvidencePrior::Magnitude { largest };
        (axes[1].centre, axes[1].deviation) = (0.0, 2.0 * largest);
    }
    Problem::new(twin, axes, records)
}

/// Evidence corrected by draws of proposals that follow the posterior.
fn corrected(problem: &Problem, fitted: &Fitted, seed: u64) -> Evidence {
    let noise = Noise::new(seed, "t", 0);
    let draws = posterior(
        problem,
        std::slice::from_ref(fitted),
        DrawsAsked::Usual,
        noise,
    )
    .unwrap();
    let found = evidence(problem, fitted, &draws, noise).unwrap();
    found.unwrap()
}

#[test]
fn a_normal_posterior_has_the_exact_evidence() {
    let records = [record(60)];
    let problem = problem(&records, None);
    let fitted = climb(&problem, &[0.0, 0.0], 40).unwrap().unwrap();
    let deviation = problem.axes[0].deviation;
    let truth = exact(&records[0], [deviation * deviation; 2]);
    let found = corrected(&problem, &fitted, 1);
    assert!((found.laplace - truth).abs() < 1e-3, "{found:?} {truth}");
    let error = found.error.unwrap();
    assert!(
        (found.log_evidence - truth).abs() < 5.0 * error + 1e-3,
        "{found:?} {truth}"
    );
    assert!(error < 0.05 && found.effective > 300.0, "{found:?}");
}

/// The seed moves the evidence by less than a tenth of a nat.
#[test]
fn the_seed_hardly_matters() {
    let records = [record(60)];
    let problem = problem(&records, Some(3.0));
    let fitted = climb(&problem, &[0.0, 0.5], 40).unwrap().unwrap();
    let values: Vec<f64> = (0..10)
        .map(|seed| corrected(&problem, &fitted, seed).log_evidence)
        .collect();
    let (low, high) = crate::math::ends(&values);
    assert!(high - low < 0.1, "{values:?}");
}

/// The size of an effect is averaged over: the mean of exact evidences at the six sizes.
#[test]
fn sizes_are_averaged_over() {
    let records = [record(60)];
    let problem = problem(&records, Some(3.0));
    let fitted = climb(&problem, &[0.0, 0.5], 40).unwrap().unwrap();
    let expansion = Expansion::new(&problem, &fitted);
    let blocks = expansion.blocks();
    let deviation = problem.axes[0].deviation;
    let each: Vec<f64> = (blocks[0].options.iter())
        .map(|size| exact(&records[0], [deviation.powi(2), size[0] * size[0]]))
        .collect();
    let found = evidence(&problem, &fitted, &PosteriorSample::default(), Noise::OFF)
        .unwrap()
        .unwrap();
    assert!(
        (found.laplace - log_mean(&each)).abs() < 0.02,
        "{found:?} {each:?}"
    );
    // A coefficient of 1.3 with unit noise is worth a lot of evidence.
    let fixed = exact(&records[0], [deviation.powi(2), 1e-12]);
    assert!(found.laplace - fixed > 10.0);
}

/// A posterior cut off by a bound keeps what lies inside.
#[test]
fn an_entry_at_its_bound_is_integrated_on_one_side() {
    let records = [record(60)];
    let mut problem = problem(&records, None);
    let mut axes = problem.axes.clone();
    axes[1].bounds = crate::twin::Interval::new(-3.0, 0.5).unwrap();
    problem = Problem::new(problem.twin.clone(), axes, records.clone());
    let fitted = climb(&problem, &[0.0, 0.0], 40).unwrap().unwrap();
    assert_eq!(fitted.theta[1], 0.5);
    let found = evidence(&problem, &fitted, &PosteriorSample::default(), Noise::OFF)
        .unwrap()
        .unwrap();
    // By quadrature over b, a in closed form.
    let deviation = problem.axes[0].deviation;
    let logs: Vec<f64> = (0..4000)
        .map(|i| {
            let b = 0.5 - (i as f64 + 0.5) * 1e-3;
            let rest = Record::new(
                records[0].drive().clone(),
                Signal::from_shape_fn((60, 1), |(k, _)| {
                    records[0].outputs()[[k, 0]] - b * records[0].drive().input(k)[0]
                }),
            );
            let density = -0.5 * (b / problem.axes[1].deviation).powi(2)
                - 0.5 * (TAU * problem.axes[1].deviation.powi(2)).ln();
            exact(&rest.unwrap(), [deviation * deviation, 1e-14]) + density
        })
        .collect();
    let truth = log_mean(&logs) + 4f64.ln();
    assert!((found.laplace - truth).abs() < 0.2, "{found:?} {truth}");
}
