//! Training on inputs moved against the network (fast gradient sign): does it help on records, inside and outside the
//! prior?
//!
//! Source: Goodfellow, Shlens & Szegedy, "Explaining and harnessing adversarial examples" (2015).

use super::{SEED, mean, records, runs, square, study};
use crate::estimator::bank::{Draw, Draws, FeatureSimulator};
use crate::estimator::readout::{Scaler, Standardiser};
use crate::estimator::{PresetName, Project};
use crate::evaluate::paper::Scenario;
use crate::math::one_row;
use crate::network::{Deep, Network, architecture};
use crate::progress::Progress;
use crate::study::Study;
use crate::twin::Noise;
use ndarray::{Array2, Axis, concatenate};
use std::borrow::Cow;

/// Step of the differences that give the sign of the gradient.
const DIFFERENCE: f64 = 1e-2;

fn bank(study: &Study, simulator: &FeatureSimulator, size: usize, purpose: &str) -> Draws {
    let drives = study.drives().unwrap();
    let space = study.twin().parameters();
    let draw = |_, _, noise| {
        Ok(Some(Draw {
            theta: space.draw_prior(noise),
            drive: Cow::Owned(drives.draw(noise).unwrap()),
        }))
    };
    let stage = Progress::silent().stage("bank", size);
    (simulator.draws(
        0..size as u64,
        |i| Noise::new(SEED, purpose, i),
        draw,
        &stage,
    ))
    .unwrap()
}

/// Rows moved by ε in the direction in which the squared error grows, input by input.
fn attacked(network: &dyn Network, z: &Array2<f64>, y: &Array2<f64>, epsilon: f64) -> Array2<f64> {
    let loss = |z: &Array2<f64>| {
        let error = network.predict(z).unwrap() - y;
        error.map_axis(Axis(1), |row| row.dot(&row))
    };
    let here = loss(z);
    let mut moved = z.clone();
    for j in 0..z.ncols() {
        let mut beside = z.clone();
        beside.column_mut(j).mapv_inplace(|v| v + DIFFERENCE);
        let slopes = loss(&beside) - &here;
        for (value, slope) in moved.column_mut(j).iter_mut().zip(&slopes) {
            *value += epsilon * slope.signum();
        }
    }
    moved
}

#[test]
#[ignore = "a study"]
fn adversarial_training_is_compared_with_plain_training() {
    for twin in ["van-der-pol", "tanks"] {
        let study = study(twin, "");
        let project = Project::from(&study);
        let preset = project.recipe(PresetName::Default);
        let simulator =
            FeatureSimulator::new(study.twin().clone(), preset.features.as_ref()).unwrap();
        let training = bank(&study, &simulator, 10_000, "bank");
        let unseen = bank(&study, &simulator, 2000, "unseen");
        let inputs = Standardiser::principal(&training.features, 6.0).unwrap();
        let targets = Scaler::fit(&training.theta);
        let (z, y) = (
            inputs.apply(&training.features),
            targets.apply(&training.theta),
        );
        let train = |z: &Array2<f64>, y: &Array2<f64>| {
            let silent = Progress::silent();
            (architecture::<Deep>().train(z, y, &preset.settings.training, 1, &silent))
                .unwrap()
                .0
        };
        let outside = records(&study, Scenario::First, runs());
        let report = |name: &str, network: &dyn Network| {
            let read = |features: &Array2<f64>| {
                targets.invert(&network.predict(&inputs.apply(features)).unwrap())
            };
            let predicted = read(&unseen.features);
            let rows = predicted.rows().into_iter().zip(unseen.theta.rows());
            let inside = mean(rows.map(|(a, b)| square(&a.to_vec(), &b.to_vec())));
            let outside = mean(outside.iter().map(|(truth, record)| {
                let x = simulator.observe(record).unwrap();
                let row = one_row(x.as_slice());
                square(&read(&row).row(0).to_vec(), truth)
            }));
            println!("{twin}, {name}: TS-pre inside {inside:.3e}, outside {outside:.3e}");
        };
        let plain = train(&z, &y);
        report("plain", plain.as_ref());
        for epsilon in [0.02, 0.05, 0.1] {
            let hard = attacked(plain.as_ref(), &z, &y, epsilon);
            let both = concatenate(Axis(0), &[z.view(), hard.view()]).unwrap();
            let twice = concatenate(Axis(0), &[y.view(), y.view()]).unwrap();
            report(&format!("ε = {epsilon}"), train(&both, &twice).as_ref());
        }
    }
}
