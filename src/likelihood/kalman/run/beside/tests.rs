//! Lanes against the scalar pass.

use super::*;
use crate::effect::{Catalogue, augment};
use crate::equations::Equations;
use crate::likelihood::kalman::{Coordinates, FilterSettings, Score};
use crate::record::{Drive, Record, Signal};
use crate::twin::{Composed, Hold, Integrator, Noise, Twin};
use crate::twins::{CascadedTanks, VanDerPol};
use nalgebra::DMatrix;
use std::sync::Arc;

const CENTRE: [f64; 4] = [0.6, 0.5, 0.55, 1.0];

fn tanks_drive() -> Drive {
    let levels = Signal::from_shape_fn((150, 1), |(k, _)| ((k / 20) * 7 % 5) as f64 * 0.6);
    Drive::new(0.5, levels).unwrap()
}

fn record(twin: impl Into<Composed>, theta: &[f64], drive: &Drive, run: u64) -> Record {
    let outputs = twin
        .into()
        .run(theta, drive, Noise::new(1, "lanes", run))
        .unwrap();
    Record::new(drive.clone(), outputs).unwrap()
}

/// θ about `centre`, each entry up to 40 % off; the first is the centre.
fn thetas(centre: &[f64]) -> Vec<Vec<f64>> {
    let mut source = Noise::new(2, "lanes", 0).source("theta");
    let mut away = |i: usize| {
        1.0 + if i == 0 {
            0.0
        } else {
            0.8 * (source.uniform() - 0.5)
        }
    };
    (0..7)
        .map(|i| centre.iter().map(|v| v * away(i)).collect())
        .collect()
}

fn agree(twin: impl Into<Composed>, centre: &[f64], record: &Record, settings: &FilterSettings) {
    let kalman = Kalman::new(twin, record, settings).unwrap().of_cells();
    agree_at(&kalman, &thetas(centre));
}

fn agree_at(kalman: &Kalman<'_>, thetas: &[Vec<f64>]) {
    let record = kalman.record;
    let all: Vec<_> = thetas.iter().map(|theta| (kalman, &theta[..])).collect();
    let held = SideBySide::of(&all).unwrap();
    let (mut pass, mut rows) = (held.pass(), LaneRows::default());
    // In blocks, as a score takes them.
    for end in [1, 64, record.samples()] {
        pass.run_to(end, &mut rows).unwrap();
    }
    for (i, theta) in thetas.iter().enumerate() {
        let lane = held.lane(i).unwrap();
        let scalar = kalman.filter(theta).unwrap();
        let found = held.log_likelihood(i, &pass.log_likelihood()).unwrap();
        let expected = scalar.log_likelihood;
        let error = (found - expected).abs() / expected.abs().max(1.0);
        assert!(error < 1e-10, "lane {lane}: {found} {expected}");
        for (k, row) in rows.0.iter().enumerate() {
            let [e, s, _] = row.seen;
            let (scale, variance) = (s.0[lane].sqrt(), scalar.covariances[[k, 0, 0]]);
            // A point within rounding of a limit, where a root bends without end, is moved by the root of rounding.
            assert!((e.0[lane] - scalar.innovations[[k, 0]]).abs() < 1e-9 * scale);
            // By the information, of which deeply saturated readings hold next to nothing: it is a difference of large numbers.
            let plain = row.plain[1].0[lane];
            assert!((plain / s.0[lane] - plain / variance).abs() < 1e-10);
        }
    }
    let near = |found: &[f64], expected: &[f64]| {
        let mut pairs = found.iter().zip(expected);
        pairs.all(|(a, b)| (a - b).abs() < 1e-7 * b.abs().max(1.0))
    };
    for (found, theta) in kalman.filter_all(thetas).unwrap().iter().zip(thetas) {
        let (found, scalar) = (found.as_ref().unwrap(), kalman.filter(theta).unwrap());
        assert!(near(&found.log_densities, &scalar.log_densities));
        let standardised = [found, &scalar].map(|of| of.standardised.as_slice().unwrap());
        assert!(near(standardised[0], standardised[1]));
        assert_eq!(found.log_densities.len(), record.samples());
    }
}

#[test]
fn lanes_are_the_scalar_pass() {
    let settings = FilterSettings::default();
    let free = Drive::autonomous(0.05, 200).unwrap();
    agree(
        VanDerPol,
        &[1.5],
        &record(VanDerPol, &[1.5], &free, 0),
        &settings,
    );
    let measured = record(CascadedTanks, &CENTRE, &tanks_drive(), 0);
    agree(CascadedTanks, &CENTRE, &measured, &settings);
    // An unknown start at the floor, where the limit is felt.
    let spread = FilterSettings {
        start_covariance: Some(DMatrix::from_diagonal_element(2, 2, 0.3)),
        ..FilterSettings::default()
    };
    agree(CascadedTanks, &CENTRE, &measured, &spread);
    // Every third output missing.
    let outputs = Signal::from_shape_fn((150, 1), |(k, _)| match k % 3 {
        1 => f64::NAN,
        _ => measured.outputs()[[k, 0]],
    });
    let gaps = Record::new(tanks_drive(), outputs).unwrap();
    agree(CascadedTanks, &CENTRE, &gaps, &settings);
    // Values on levels, which hold the noise up.
    let levels = measured.outputs().mapv(|y| (y / 0.7).round() * 0.7);
    let rounded = Record::new(tanks_drive(), levels).unwrap();
    agree(CascadedTanks, &CENTRE, &rounded, &settings);
}

/// A ceiling acts on some lanes and not on others; a lag adds a state; a forces law acts on each point.
#[test]
fn lanes_of_twins_with_effects_are_the_scalar_pass() {
    let settings = FilterSettings::default();
    let library = Catalogue::default();
    let ceiling = library
        .effect("state-ceiling", "h1")
        .unwrap()
        .with_other("h2");
    let lag = library.effect("sensor-lag", "sensor").unwrap();
    let drag = library.effect("quadratic-drag", "h1").unwrap();
    for (effect, magnitudes) in [(ceiling, &[3.0, 0.5][..]), (lag, &[1.2]), (drag, &[0.05])] {
        let twin = augment(Arc::new(CascadedTanks), vec![effect]).unwrap();
        let twin = twin.equations().unwrap();
        let centre = [&CENTRE[..], magnitudes].concat();
        let measured = record(twin, &centre, &tanks_drive(), 1);
        agree(twin, &centre, &measured, &settings);
    }
}

fn pendulum() -> (Arc<Equations>, Drive) {
    let text = include_str!("../../../../../examples/pendulum.toml");
    let levels = Signal::from_shape_fn((120, 1), |(k, _)| ((k / 15) * 7 % 5) as f64 * 0.4 - 0.8);
    let drive = Drive::new(0.05, levels).unwrap();
    (Arc::new(Equations::parse(text).unwrap()), drive)
}

/// The text with an effect, where one is named.
fn with_effect(text: &Arc<Equations>, id: &str, target: &str) -> Twin {
    let effect = (!id.is_empty()).then(|| Catalogue::default().effect(id, target).unwrap());
    augment(text.clone(), effect.into_iter().collect()).unwrap()
}

/// In fixed steps all lanes are those of the scalar pass, whatever their θ: substeps, inputs on lines, and parts that act on the motion.
#[test]
fn lanes_of_texts_in_fixed_steps_are_the_scalar_pass() {
    let (text, drive) = pendulum();
    let settings = FilterSettings::default();
    let all: [(&str, &str, &[f64]); 4] = [
        ("", "", &[]),
        ("sensor-lag", "sensor", &[0.1]),
        ("quadratic-drag", "v", &[0.2]),
        ("parameter-drift", "c", &[0.2]),
    ];
    for (id, target, magnitudes) in all {
        let twin = with_effect(&text, id, target);
        for rule in [Integrator::Euler, Integrator::RungeKutta4] {
            let twin = twin.stepped(|own, stepping| {
                (*own, stepping.substeps, stepping.hold) = (rule, 2, Hold::Linear);
            });
            let twin = twin.unwrap();
            let twin = twin.equations().unwrap();
            let centre = [&[1.0, 0.3], magnitudes].concat();
            let measured = record(twin, &centre, &drive, 1);
            agree(twin, &centre, &measured, &settings);
        }
    }
}

/// Texts in adaptive steps, which are those of the first lane: where all lanes have its θ, they are the scalar pass. With a start of a sensor's
/// memory, a force, a parameter that time moves, and limits that act.
#[test]
fn lanes_of_texts_are_the_scalar_pass() {
    let (text, drive) = pendulum();
    let own = [1.0, 0.3];
    let settings = FilterSettings::default();
    let all: [(&str, &str, &[f64]); 6] = [
        ("", "", &[]),
        ("sensor-lag", "sensor", &[0.1]),
        ("quadratic-drag", "v", &[0.2]),
        ("parameter-drift", "c", &[0.2]),
        ("state-ceiling", "q", &[0.25, 0.0]),
        ("sensor-saturation", "sensor", &[-0.2, 0.2]),
    ];
    for (id, target, magnitudes) in all {
        let twin = with_effect(&text, id, target);
        let theta = [&own[..], &magnitudes[..twin.parameters().len() - 2]].concat();
        let twin = twin.equations().unwrap();
        let measured = record(twin, &theta, &drive, 1);
        let kalman = Kalman::new(twin, &measured, &settings).unwrap().of_cells();
        agree_at(&kalman, &vec![theta; 8]);
        // Elsewhere the steps of the first one keep the tolerance nearly as well as own ones.
        let around = thetas(&kalman.parameters().centre());
        let together = kalman.log_likelihoods(&around).unwrap();
        for (together, theta) in together.iter().zip(&around) {
            let alone = kalman.log_likelihood(theta);
            if let (Some(together), Ok(alone)) = (together, alone) {
                assert!(
                    (together - alone).abs() < 1e-3 * alone.abs().max(1.0),
                    "{id}"
                );
            }
        }
    }
}

#[test]
fn a_score_by_lanes_is_that_of_single_passes() {
    let measured = record(CascadedTanks, &CENTRE, &tanks_drive(), 0);
    let settings = FilterSettings::default();
    let kalman = Kalman::new(CascadedTanks, &measured, &settings).unwrap();
    let coordinates = Coordinates::new(kalman.parameters());
    let one = Score::forward_one_by_one(&kalman, &CENTRE, &coordinates).unwrap();
    let lanes = Score::forward(&kalman, &CENTRE, &coordinates).unwrap();
    assert!((lanes.log_likelihood - one.log_likelihood).abs() < 1e-9);
    // Differences over steps of 1e-5 in log θ.
    assert!((&lanes.gradient - &one.gradient).amax() < 1e-6);
    assert!((&lanes.fisher - &one.fisher).amax() < 1e-8 * one.fisher.amax());
}

/// Records run beside others have the bits that they have alone, where limits act on some and not on others, too.
#[test]
fn no_lane_changes_a_bit_of_another() {
    let settings = FilterSettings::default();
    let ceiling = Catalogue::default()
        .effect("state-ceiling", "h1")
        .unwrap()
        .with_other("h2");
    let twin = augment(Arc::new(CascadedTanks), vec![ceiling]).unwrap();
    let twin = twin.equations().unwrap();
    let theta = [&CENTRE[..], &[3.0, 0.5]].concat();
    let records: Vec<Record> = (0..11)
        .map(|run| {
            let drive = tanks_drive();
            let inputs = drive.inputs() * (0.1 + 0.2 * run as f64);
            let drive = drive.with_inputs(inputs).unwrap();
            record(twin, &theta, &drive, run)
        })
        .collect();
    let kalmans: Vec<Kalman<'_>> = (records.iter())
        .map(|record| Kalman::new(twin, record, &settings).unwrap())
        .collect();
    let coordinates = Coordinates::new(kalmans[0].parameters());
    let all = Score::forward_all(&kalmans, &theta, &coordinates);
    for (kalman, beside) in kalmans.iter().zip(all) {
        let alone = Score::forward(kalman, &theta, &coordinates).unwrap();
        assert_eq!(beside.unwrap(), alone);
    }
}

/// A θ that lanes do not hold goes the scalar way, errors included; a sensor that bends its signal goes side by side.
#[test]
fn what_lanes_do_not_hold_is_run_one_by_one() {
    let settings = FilterSettings::default();
    let measured = record(CascadedTanks, &CENTRE, &tanks_drive(), 0);
    let kalman = Kalman::new(CascadedTanks, &measured, &settings).unwrap();
    let coordinates = Coordinates::new(kalman.parameters());
    let both = [(&kalman, &[f64::NAN; 4][..]), (&kalman, &CENTRE)];
    let held = SideBySide::of(&both).unwrap();
    let mut pass = held.pass();
    pass.run_to(measured.samples(), &mut ()).unwrap();
    let is_found = |i| held.log_likelihood(i, &pass.log_likelihood()).is_some();
    assert_eq!([0, 1].map(is_found), [false, true]);
    assert!(SideBySide::of(&[(&kalman, &CENTRE[..3])]).is_none());
    assert!(Score::forward(&kalman, &[f64::NAN; 4], &coordinates).is_err());
    assert!(Score::forward(&kalman, &[1.0], &coordinates).is_err());
    let saturated = Catalogue::default()
        .effect("sensor-saturation", "sensor")
        .unwrap();
    let twin = augment(Arc::new(CascadedTanks), vec![saturated]).unwrap();
    let twin = twin.equations().unwrap();
    let theta = [&CENTRE[..], &[0.0, 2.0]].concat();
    let measured = record(twin, &theta, &tanks_drive(), 0);
    let kalman = Kalman::new(twin, &measured, &settings).unwrap();
    assert!(SideBySide::of(&[(&kalman, &theta)]).is_some());
    let coordinates = Coordinates::new(kalman.parameters());
    let one = Score::forward_one_by_one(&kalman, &theta, &coordinates).unwrap();
    let beside = Score::forward(&kalman, &theta, &coordinates).unwrap();
    assert!((beside.log_likelihood - one.log_likelihood).abs() < 1e-9);
    assert!((&beside.gradient - &one.gradient).amax() < 1e-5);
}
