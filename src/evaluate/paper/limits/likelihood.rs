//! Maximum likelihood and the Cramér–Rao bound on the same records.

use super::{mean, pretrained, records, refined, runs, square, study};
use crate::evaluate::paper::Scenario;
use crate::likelihood::kalman::{Coordinates, FilterSettings, Kalman, Score};
use crate::record::Record;
use crate::study::Study;
use rayon::prelude::*;

/// Fisher scoring on the filter's likelihood from the truth, within the bounds.
fn maximum_likelihood(study: &Study, record: &Record, truth: &[f64]) -> Vec<f64> {
    let settings = FilterSettings::default();
    let twin = study.twin();
    let kalman = Kalman::new(twin.equations().unwrap(), record, &settings).unwrap();
    let coordinates = Coordinates::new(&twin.parameters());
    let mut theta = truth.to_vec();
    let mut score = Score::at(&kalman, &theta).unwrap();
    for _ in 0..30 {
        let step = score
            .fisher
            .clone()
            .cholesky()
            .unwrap()
            .solve(&score.gradient);
        let phi = coordinates.of(&theta);
        let mut share = 1.0;
        let better = loop {
            let moved: Vec<f64> = (phi.iter().zip(&step))
                .map(|(p, s)| p + share * s)
                .collect();
            let there = coordinates.theta(&moved);
            let next = Score::at(&kalman, &there).unwrap();
            if next.log_likelihood >= score.log_likelihood {
                break Some((there, next));
            }
            share *= 0.5;
            if share < 1e-6 {
                break None;
            }
        };
        let Some((there, next)) = better else { break };
        let gain = next.log_likelihood - score.log_likelihood;
        (theta, score) = (there, next);
        if gain < 1e-9 {
            break;
        }
    }
    theta
}

/// Mean over parameters of the Cramér–Rao bound at the truth, in parameter units.
pub(super) fn cramer_rao(study: &Study, record: &Record, truth: &[f64]) -> f64 {
    let settings = FilterSettings::default();
    let twin = study.twin();
    let kalman = Kalman::new(twin.equations().unwrap(), record, &settings).unwrap();
    let score = Score::at(&kalman, truth).unwrap();
    let covariance = score.fisher.try_inverse().unwrap();
    let slopes = Coordinates::new(&twin.parameters()).slopes(truth);
    mean((0..truth.len()).map(|j| covariance[(j, j)] * slopes[j].powi(2)))
}

/// Tuned heads against maximum likelihood, oscillator.
#[test]
#[ignore = "a study"]
fn tuned_heads_are_as_good_as_maximum_likelihood() {
    let study = study("van-der-pol", "");
    let estimator = pretrained(&study);
    for scenario in [Scenario::First, Scenario::Second, Scenario::InDistribution] {
        let records = records(&study, scenario, runs());
        let rows: Vec<[f64; 4]> = (records.par_iter().enumerate())
            .map(|(run, (truth, record))| {
                let estimate = refined(&estimator, record, run);
                [
                    square(&estimate.fine.unwrap(), truth),
                    square(&estimate.gauss_newton.unwrap(), truth),
                    square(&maximum_likelihood(&study, record, truth), truth),
                    cramer_rao(&study, record, truth),
                ]
            })
            .collect();
        let [fine, newton, likelihood, bound] =
            [0, 1, 2, 3].map(|k| mean(rows.iter().map(|r| r[k])));
        println!(
            "{scenario:?}: TS-fine {fine:.2e}, Gauss–Newton {newton:.2e}, maximum likelihood {likelihood:.2e}, \
             Cramér–Rao {bound:.2e}; TS-fine over maximum likelihood {:.3}",
            fine / likelihood
        );
        assert!(fine / likelihood < 1.3);
    }
}
