//! Events of twins as text: restitutions and thresholds from records of exact solutions.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use truetwin::fit::Fit;
use truetwin::prelude::*;
use truetwin::study::StudyFile;

/// A fit to values at these times, with noise.
fn fitted(text: &str, (dt, level): (f64, f64), seed: u64, exact: &[f64]) -> Fit {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let outputs = Signal::from_shape_fn((exact.len(), 1), |(k, _)| {
        exact[k] + level * random.sample::<f64, _>(StandardNormal)
    });
    let record = Record::new(Drive::autonomous(dt, exact.len()).unwrap(), outputs).unwrap();
    let file = StudyFile::parse(text, "twin.toml".as_ref()).unwrap();
    Study::of_file(&file).unwrap().fit(&[record]).unwrap()
}

/// Checks that a parameter is within three and a half errors, which are neither none nor the prior's.
fn holds(fit: &Fit, name: &str, truth: f64, largest: f64) {
    let found = fit.parameters.iter().find(|p| p.name == name).unwrap();
    let off = (found.value - truth) / found.std_error;
    assert!(off.abs() < 3.5, "{name} = {}: {off} errors", found.value);
    let error = found.std_error;
    assert!(error > 0.0 && error < largest, "{name}: {error}");
}

/// A ball from 2 m, without process noise and with what is fitted of it.
#[test]
fn the_restitution_of_a_ball_is_fitted() {
    let (e, g, dt) = (0.8, 9.81, 0.05);
    let height = |t: f64| {
        let mut speed = f64::sqrt(4.0 * g);
        let mut since = t - speed / g;
        if since < 0.0 {
            return 2.0 - 0.5 * g * t * t;
        }
        loop {
            speed *= e;
            if since < 2.0 * speed / g {
                return speed * since - 0.5 * g * since * since;
            }
            since -= 2.0 * speed / g;
        }
    };
    let exact: Vec<f64> = (0..50).map(|k| height(f64::from(k) * dt)).collect();
    for (seed, process) in [(1, "none"), (2, "none"), (3, "fitted")] {
        let text = format!(
            "[parameters]\ne = {{ prior = [0.5, 0.95], bounds = [0.1, 1.0] }}\ng = {{ prior = [8.0, 12.0], bounds = [1.0, 30.0] }}\n\
             [states]\nh = {{ rate = \"v\", start = 2.0 }}\nv = {{ rate = \"-g\", start = 0.0 }}\n\
             [outputs]\ny = {{ value = \"h\", noise = 0.01 }}\n[[event]]\nwhen = \"h < 0\"\nset = {{ h = 0, v = \"-e*v\" }}\n\
             [noise]\nprocess = \"{process}\"\n"
        );
        let fit = fitted(&text, (dt, 0.01), seed, &exact);
        holds(&fit, "e", e, 0.02);
        holds(&fit, "g", g, 0.2);
    }
}

/// A tank that fills, and whose valve opens at a threshold and closes at 0.6 m.
#[test]
fn the_threshold_of_a_tank_is_fitted() {
    let (top, k, dt) = (3.0, 0.05, 0.5);
    // Both ways h → q + (h₀ − q)·e^{−at}, with q = 0.3/a.
    let mut exact = vec![];
    let (mut h0, mut since, mut is_open) = (0.5, 0.0, false);
    for row in 0..160 {
        let t = f64::from(row) * dt;
        exact.push(loop {
            let (a, end): (f64, f64) = match is_open {
                true => (k + 0.7, 0.6),
                false => (k, top),
            };
            let q = 0.3 / a;
            let way = ((h0 - q) / (end - q)).ln() / a;
            if t - since <= way {
                break q + (h0 - q) * (-a * (t - since)).exp();
            }
            (since, h0, is_open) = (since + way, end, !is_open);
        });
    }
    for seed in 1..4 {
        let text = "[parameters]\ntop = { prior = [2.0, 4.0], bounds = [0.8, 5.0] }\nk = { prior = [0.01, 0.1], bounds = [0.001, 0.5] }\n\
             [states]\nh = { rate = \"0.3 - (k + 0.7*open)*h\", start = 0.5 }\nopen = { rate = \"0\", start = 0 }\n\
             [outputs]\ny = { value = \"h\", noise = 0.05 }\n\
             [[event]]\nwhen = \"h > top\"\nset = { open = 1 }\n[[event]]\nwhen = \"h < 0.6\"\nset = { open = 0 }\n\
             [noise]\nprocess = \"none\"\n";
        let fit = fitted(text, (dt, 0.05), seed, &exact);
        holds(&fit, "top", top, 0.2);
        holds(&fit, "k", k, 0.01);
    }
}
