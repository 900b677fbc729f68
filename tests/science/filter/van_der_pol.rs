//! The position is measured exactly, so that second differences give the likelihood in closed form.

use super::{maximum_likelihood, mean, record};
use truetwin::likelihood::kalman::{FilterSettings, Kalman, Method, Score};
use truetwin::record::{Drive, Record};
use truetwin::twins::VanDerPol;

const DT: f64 = 0.05;

fn simulated(nu: f64, run: u64) -> Record {
    record(&VanDerPol, &[nu], Drive::autonomous(DT, 300).unwrap(), run)
}

/// log p of rows 2 … N − 1, its derivative in ν, its curvature, and the maximum: rows 0 and 1 do not depend on ν.
fn closed_form(record: &Record, nu: f64) -> (f64, f64, f64, f64) {
    let y = record.outputs().column(0).to_vec();
    // Increment of x₂: Δt·w, variance 0.02·Δt²; of the position, Δt times that.
    let variance = 0.02 * DT.powi(4);
    let (mut value, mut slope, mut curvature) = (0.0, 0.0, 0.0);
    for k in 0..y.len() - 2 {
        let speed = if k == 0 { 0.0 } else { (y[k + 1] - y[k]) / DT };
        let push = DT * DT * (1.0 - y[k] * y[k]) * speed;
        let e = y[k + 2] - y[k + 1] - DT * speed - nu * push + DT * DT * y[k];
        value -= 0.5 * (e * e / variance + (2.0 * std::f64::consts::PI * variance).ln());
        slope += e * push / variance;
        curvature += push * push / variance;
    }
    (value, slope, curvature, nu + slope / curvature)
}

#[test]
fn likelihood_and_score_are_the_closed_form() {
    for (nu, run) in [(0.7, 0), (3.0, 1), (5.0, 2)] {
        let record = simulated(nu, run);
        for method in [Method::Points, Method::Extended] {
            let settings = FilterSettings::default().with_method(method);
            let kalman = Kalman::new(VanDerPol, &record, &settings).unwrap();
            let filtered = kalman.filter(&[nu]).unwrap();
            let (value, _, information, best) = closed_form(&record, nu);
            let last: f64 = filtered.log_densities[2..].iter().sum();
            let score = Score::at(&kalman, &[nu]).unwrap();
            let (_, slope, ..) = closed_form(&record, nu);
            let error = (score.gradient[0] - slope) / information.sqrt();
            let sd = 1.0 / information.sqrt();
            println!(
                "nu {nu} {method:?}: log-likelihood off by {:.1e}, score by {error:.1e} sd, ML {best:.4} ± {sd:.4}",
                last - value
            );
            assert!((last - value).abs() < 0.02, "{method:?}: {last} {value}");
            assert!(error.abs() < 1e-3, "{method:?}: {error}");
        }
    }
}

/// Between records the error of maximum likelihood is what the information says; 2.65e-5 at ν = 3 in the prototypes.
#[test]
fn maximum_likelihood_is_efficient() {
    let (mut squares, mut expected, mut exact) = (vec![], vec![], vec![]);
    for run in 0..60 {
        let record = simulated(3.0, 100 + run);
        let (theta, _) = maximum_likelihood(VanDerPol, &record, &[2.5]);
        let (.., information, best) = closed_form(&record, 3.0);
        squares.push((theta[0] - 3.0).powi(2));
        expected.push(1.0 / information);
        exact.push((theta[0] - best).abs());
    }
    let most = exact.iter().copied().fold(0.0, f64::max);
    println!(
        "MSE {:.3e}, information says {:.3e}; furthest from the exact maximum {most:.1e}",
        mean(&squares),
        mean(&expected)
    );
    // Relative sd of a mean of 60 squares: √(2/60) = 0.18; four of them.
    assert!((mean(&squares) / mean(&expected) - 1.0).abs() < 0.73);
    assert!(most < 1e-4, "{most}");
}

/// The smoother knows the speed from the positions around it.
#[test]
fn smoothed_speeds_are_differences_of_positions() {
    let record = simulated(1.0, 7);
    let smoothed = Kalman::new(VanDerPol, &record, &FilterSettings::default())
        .and_then(|k| k.smooth(&[1.0]))
        .unwrap();
    let y = record.outputs();
    for k in 0..299 {
        let speed = (y[[k + 1, 0]] - y[[k, 0]]) / DT;
        let error = (smoothed.means[[k, 1]] - speed).abs();
        assert!(error < 1e-4, "row {k}: {error}");
    }
}
