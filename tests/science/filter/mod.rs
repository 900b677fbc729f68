//! Filters on the reference twins, against exact and particle likelihoods.

mod particle;
mod tanks;
mod van_der_pol;

use nalgebra::DVector;
use truetwin::likelihood::kalman::{Coordinates, FilterSettings, Kalman, Score};
use truetwin::record::{Drive, Record};
use truetwin::twin::{Composed, DigitalTwin, Noise};

/// A record of `twin` at `theta`, number `run`.
fn record(twin: &dyn DigitalTwin, theta: &[f64], drive: Drive, run: u64) -> Record {
    let outputs = twin
        .simulate(theta, &drive, Noise::new(1, "filter", run))
        .unwrap();
    Record::new(drive, outputs).unwrap()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Maximum likelihood by Fisher scoring, halved until it climbs; θ and its standard errors.
fn maximum_likelihood(
    twin: impl Into<Composed>,
    record: &Record,
    start: &[f64],
) -> (Vec<f64>, Vec<f64>) {
    let settings = FilterSettings::default();
    let kalman = Kalman::new(twin, record, &settings).unwrap();
    let coordinates = Coordinates::new(kalman.parameters());
    let mut theta = start.to_vec();
    let mut errors = vec![];
    for _ in 0..40 {
        let score = Score::at(&kalman, &theta).unwrap();
        let covariance = score.fisher.clone().try_inverse().unwrap();
        let slopes = coordinates.slopes(&theta);
        errors = (0..theta.len())
            .map(|j| covariance[(j, j)].sqrt() * slopes[j])
            .collect();
        let mut step = covariance * &score.gradient;
        step *= (0.5 / step.amax()).min(1.0);
        let from = DVector::from_vec(coordinates.of(&theta));
        let climbed = (0..12).find_map(|_| {
            let to = coordinates.theta((&from + &step).as_slice());
            step *= 0.5;
            let value = kalman.log_likelihood(&to).ok()?;
            (value > score.log_likelihood).then_some(to)
        });
        let Some(to) = climbed else { break };
        theta = to;
        if step.amax() < 1e-6 {
            break;
        }
    }
    (theta, errors)
}
