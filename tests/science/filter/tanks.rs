//! Limits, root laws, unknown starts: where filters are approximations.

use super::{maximum_likelihood, mean, particle, record};
use rayon::prelude::*;
use std::sync::Arc;
use truetwin::effect::*;
use truetwin::likelihood::kalman::{FilterSettings, Kalman, Method, Score};
use truetwin::record::*;
use truetwin::study::{RecordPlan, Study, StudyFile};
use truetwin::twin::*;
use truetwin::twins::CascadedTanks;

const CENTRE: [f64; 4] = [0.6, 0.5, 0.55, 1.0];

/// 400 rows of levels in [0, 3], each held for 30.
fn levels(run: u64) -> Drive {
    let mut source = Noise::new(2, "levels", run).source("u");
    let levels: Vec<f64> = (0..14).map(|_| 3.0 * source.uniform()).collect();
    Drive::new(
        0.5,
        Signal::from_shape_fn((400, 1), |(k, _)| levels[k / 30]),
    )
    .unwrap()
}

fn simulated(theta: &[f64], run: u64) -> Record {
    record(&CascadedTanks, theta, levels(run), run)
}

/// The tanks in the setting of a study file.
fn adapted(tables: &str) -> Twin {
    let plan = RecordPlan::levels(0.5, 400, 0.0, 3.0, 30);
    let study = Study::new("tanks", CascadedTanks, plan).unwrap();
    let file = StudyFile::parse(&format!("twin = 'tanks'\n{tables}"), "S.toml".as_ref()).unwrap();
    study.configure(&file).unwrap().twin().clone()
}

/// Over 60 records: squares of standardised innovations have mean 1, and innovations do not predict each other.
#[test]
fn innovations_are_white_with_unit_variance() {
    let settings = FilterSettings::default();
    let runs: Vec<Vec<f64>> = (0..60)
        .into_par_iter()
        .map(|run| {
            let record = simulated(&CENTRE, run);
            let found = Kalman::new(CascadedTanks, &record, &settings)
                .and_then(|k| k.filter(&CENTRE))
                .unwrap();
            found.standardised.iter().copied().collect()
        })
        .collect();
    let n = (60 * 400) as f64;
    let square = runs.iter().flatten().map(|z| z * z).sum::<f64>() / n;
    println!("mean square {square:.4}");
    // sd of a mean of n squares: √(2/n) = 0.009
    assert!((square - 1.0).abs() < 4.5 * (2.0 / n).sqrt(), "{square}");
    for lag in 1..=5 {
        let sum: f64 = runs
            .iter()
            .flat_map(|z| z.iter().zip(&z[lag..]))
            .map(|(a, b)| a * b)
            .sum();
        assert!((sum / n).abs() < 4.5 / n.sqrt(), "lag {lag}: {}", sum / n);
    }
}

/// Parameters at which levels touch the floor, the ceiling, or both.
const CORNERS: [[f64; 4]; 4] = [
    CENTRE,
    [1.2, 1.2, 0.9, 1.0],
    [1.3, 1.3, 0.6, 0.7],
    [0.4, 0.7, 0.4, 1.2],
];

fn log_likelihood_by(method: Method, theta: &[f64], record: &Record) -> f64 {
    let settings = FilterSettings::default().with_method(method);
    Kalman::new(CascadedTanks, record, &settings)
        .and_then(|kalman| kalman.log_likelihood(theta))
        .unwrap()
}

/// Where levels touch the floor and the ceiling: both methods within 4 nats on average.
#[test]
fn limits_are_felt_as_a_particle_filter_feels_them() {
    for theta in CORNERS {
        let differences: Vec<[f64; 2]> = (0..8)
            .into_par_iter()
            .map(|run| {
                let record = simulated(&theta, run);
                let truth = particle::log_likelihood(&CascadedTanks, &theta, &record, 8000, run);
                [Method::Points, Method::Extended]
                    .map(|method| log_likelihood_by(method, &theta, &record) - truth)
            })
            .collect();
        let [points, extended] =
            [0, 1].map(|m| mean(&differences.iter().map(|d| d[m]).collect::<Vec<_>>()));
        println!("{theta:?}: points {points:.2}, extended {extended:.2} nats");
        assert!(points.abs() < 3.0, "{theta:?}: {points}");
        assert!(extended.abs() < 4.0, "{theta:?}: {extended}");
    }
}

/// At the truth the linearised filter is within a nat of the points on average; away from it within a seventh of what the
/// wrong parameters lose, so that searches by either climb alike.
#[test]
fn the_linearised_filter_agrees_with_the_points() {
    for truth in CORNERS {
        for theta in CORNERS {
            let pairs: Vec<[f64; 2]> = (0..8)
                .map(|run| {
                    let record = simulated(&truth, run);
                    let of = |theta: &[f64]| log_likelihood_by(Method::Points, theta, &record);
                    let points = of(&theta);
                    let extended = log_likelihood_by(Method::Extended, &theta, &record);
                    [extended - points, of(&truth) - points]
                })
                .collect();
            let [difference, loss] =
                [0, 1].map(|i| mean(&pairs.iter().map(|p| p[i]).collect::<Vec<_>>()));
            println!("{truth:?} at {theta:?}: {difference:.2} of {loss:.0} nats");
            assert!(difference.abs() < 1.0 + loss.max(0.0) / 7.0, "{difference}");
        }
    }
}

/// Starts are parameters: their errors are what the information says.
#[test]
fn an_unknown_start_is_found() {
    let twin = adapted("[start]\nh1 = 'estimate'\nh2 = 'estimate'");
    let equations = twin.equations().unwrap();
    let truth = [0.6, 0.5, 0.55, 1.0, 3.0, 6.0];
    let errors: Vec<[f64; 2]> = (0..12)
        .into_par_iter()
        .map(|run| {
            let record = record(&twin, &truth, levels(run), run);
            let begin = [0.55, 0.55, 0.55, 1.0, 4.0, 5.0];
            let (theta, sd) = maximum_likelihood(equations, &record, &begin);
            [4, 5].map(|j| (theta[j] - truth[j]) / sd[j])
        })
        .collect();
    let squares: f64 = errors.iter().flatten().map(|z| z * z).sum();
    println!(
        "squared errors of starts over their variances: {:.2}",
        squares / 24.0
    );
    // χ² with 24 degrees of freedom: below 6 with 3e-6, above 62 with 3e-5.
    assert!((6.0..62.0).contains(&squares), "{squares}");
}

/// Noise levels are parameters too: the score at the truth is zero on average, and negative in a level that is too high.
#[test]
fn noise_levels_are_parameters() {
    let twin = adapted("[noise]\nh1 = 'estimate'\nh2 = 'estimate'\ny = 'estimate'");
    let equations = twin.equations().unwrap();
    let mut truth = CENTRE.to_vec();
    for name in &twin.parameters().names()[4..] {
        truth.push(if *name == "noise.y" { 0.15 } else { 0.1 });
    }
    let settings = FilterSettings::default();
    let scores: Vec<[f64; 3]> = (0..40)
        .into_par_iter()
        .map(|run| {
            let record = simulated(&CENTRE, run);
            let kalman = Kalman::new(equations, &record, &settings).unwrap();
            let score = Score::at(&kalman, &truth).unwrap();
            std::array::from_fn(|j| score.gradient[4 + j] / score.fisher[(4 + j, 4 + j)].sqrt())
        })
        .collect();
    for j in 0..3 {
        let z = scores.iter().map(|s| s[j]).sum::<f64>() / 40f64.sqrt();
        println!("score of {}: {z:.2}", twin.parameters().names()[4 + j]);
        assert!(z.abs() < 4.5, "{z}");
    }
}

/// Effects that are off leave the likelihood: memories have no noise of their own and cost nothing but time.
#[test]
fn effects_that_are_off_leave_the_likelihood() {
    let record = simulated(&CENTRE, 3);
    let settings = FilterSettings::default();
    let base = Kalman::new(CascadedTanks, &record, &settings)
        .and_then(|k| k.log_likelihood(&CENTRE))
        .unwrap();
    let library = Catalogue::default();
    let listed = |id, target| library.effect(id, target).unwrap();
    let effects = vec![
        listed("sensor-lag", "sensor"),
        listed("actuator-lag", "actuator"),
    ];
    let twin = augment(Arc::new(CascadedTanks), effects).unwrap();
    let mut theta = CENTRE.to_vec();
    theta.extend([0.0, 0.0]);
    let equations = twin.equations().unwrap();
    let off = Kalman::new(equations, &record, &settings)
        .and_then(|k| k.log_likelihood(&theta))
        .unwrap();
    assert!((off - base).abs() < 1e-6, "{off} {base}");
    theta[4] = 2.0;
    let on = Kalman::new(equations, &record, &settings)
        .and_then(|k| k.log_likelihood(&theta))
        .unwrap();
    assert!(on < base - 5.0, "{on} {base}");

    // A ceiling is a constraint: points go through it.
    let ceiling = vec![listed("state-ceiling", "h1").with_other("h2")];
    let twin = augment(Arc::new(CascadedTanks), ceiling).unwrap();
    let equations = twin.equations().unwrap();
    let mut theta = CENTRE.to_vec();
    theta.extend([f64::INFINITY, 0.5]);
    let off = Kalman::new(equations, &record, &settings)
        .and_then(|k| k.log_likelihood(&theta))
        .unwrap();
    assert!((off - base).abs() < 1e-9, "{off} {base}");
    theta[4] = 3.0;
    let spilled = super::record(&twin, &theta, levels(3), 3);
    let known = Kalman::new(equations, &spilled, &settings)
        .and_then(|k| k.log_likelihood(&theta))
        .unwrap();
    let unknown = Kalman::new(CascadedTanks, &spilled, &settings)
        .and_then(|k| k.log_likelihood(&CENTRE))
        .unwrap();
    assert!(known > unknown + 10.0, "{known} {unknown}");
}

/// Outliers make rows a mixture: the score at the truth has mean zero, and off they change no bit.
#[test]
fn outliers_are_a_mixture() {
    let outliers = Catalogue::default().effect("sensor-outliers", "sensor");
    let effects = vec![outliers.unwrap()];
    let twin = augment(Arc::new(CascadedTanks), effects).unwrap();
    let equations = twin.equations().unwrap();
    let settings = FilterSettings::default();
    let with = |m: [f64; 2]| [&CENTRE[..], &m].concat();
    let truth = with([0.05, 1.5]);
    let scores: Vec<[f64; 2]> = (0..40)
        .into_par_iter()
        .map(|run| {
            let record = record(&twin, &truth, levels(run), run);
            let kalman = Kalman::new(equations, &record, &settings).unwrap();
            let plain = kalman.log_likelihood(&with([0.0, 1.5])).unwrap();
            let base = Kalman::new(CascadedTanks, &record, &settings)
                .and_then(|k| k.log_likelihood(&CENTRE))
                .unwrap();
            assert_eq!(plain, base);
            assert!(kalman.log_likelihood(&truth).unwrap() > plain + 50.0);
            let score = Score::at(&kalman, &truth).unwrap();
            std::array::from_fn(|j| score.gradient[4 + j])
        })
        .collect();
    for j in 0..2 {
        let own: Vec<f64> = scores.iter().map(|s| s[j]).collect();
        let square: f64 = own.iter().map(|g| g * g).sum();
        let z = own.iter().sum::<f64>() / square.sqrt();
        println!("score of magnitude {j}: {z:.2}");
        assert!(z.abs() < 4.5, "{z}");
    }
}

/// Smoothed levels are within the limits, closer to the truth than filtered ones, and cover it.
#[test]
fn smoothing_brings_levels_closer() {
    let settings = FilterSettings {
        keep_states: true,
        ..FilterSettings::default()
    };
    /// Tanks whose sensors show both levels without noise: the truth of a run.
    struct Levels;
    impl StateSpace for Levels {
        fn outline(&self) -> Outline {
            Outline {
                outputs: vec![Quantity::new("h1", "V"), Quantity::new("h2", "V")],
                ..CascadedTanks.outline()
            }
        }
        fn drift(&self, now: &Now<'_>, h: &[f64], dh: &mut [f64]) {
            CascadedTanks.drift(now, h, dh);
        }
        fn observe(&self, _: &Now<'_>, h: &[f64], y: &mut [f64]) {
            y.copy_from_slice(h);
        }
        fn noise(&self, _: &Now<'_>, _: &[f64], process: &mut [f64], _: &mut [f64]) {
            process.fill(0.1);
        }
        fn limits(&self) -> Vec<Interval> {
            CascadedTanks.limits()
        }
    }
    let (mut before, mut after, mut inside) = (0.0, 0.0, 0.0);
    for run in 0..8 {
        let (drive, noise) = (levels(run), Noise::new(1, "filter", run));
        let truth = Levels.simulate(&CENTRE, &drive, noise).unwrap();
        let record = simulated(&CENTRE, run);
        let filtered = Kalman::new(CascadedTanks, &record, &settings)
            .and_then(|k| k.filter(&CENTRE))
            .unwrap();
        let smoothed = Kalman::new(CascadedTanks, &record, &settings)
            .and_then(|k| k.smooth(&CENTRE))
            .unwrap();
        let squares = |means: &Signal| (&truth - means).mapv(|e| e * e).mean().unwrap();
        before += squares(&filtered.states.unwrap().means) / 8.0;
        after += squares(&smoothed.means) / 8.0;
        assert!(smoothed.means.iter().all(|h| (0.0..=10.0).contains(h)));
        let z = (&truth - &smoothed.means) / smoothed.standard_deviations().mapv(|s| s.max(1e-6));
        inside += z.mapv(|z| f64::from(z.abs() < 1.645)).mean().unwrap() / 8.0;
    }
    println!(
        "mean squared error {before:.4} filtered, {after:.4} smoothed; {inside:.3} inside 90 %"
    );
    assert!(after < 0.95 * before);
    assert!((inside - 0.9).abs() < 0.04, "{inside}");
}

#[test]
fn threads_change_no_bit() {
    let records: Vec<Record> = (0..6).map(|run| simulated(&CENTRE, run)).collect();
    let settings = FilterSettings::default();
    let on = |threads: usize| -> Vec<f64> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            (records.par_iter())
                .map(|record| {
                    Kalman::new(CascadedTanks, record, &settings)
                        .and_then(|k| k.log_likelihood(&CENTRE))
                        .unwrap()
                })
                .collect()
        })
    };
    assert_eq!(on(1), on(3));
}
