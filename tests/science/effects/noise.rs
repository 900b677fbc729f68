//! Effects that are noise, and the draws of those that are not.

use super::*;

/// Noise minus free run is the same with a linear effect as without: no draw has moved.
#[test]
fn effects_move_no_draws() {
    let (_, base, theta, drive) = twins().remove(0);
    let noise = Noise::new(4, "draws", 0);
    let part = |effects: &[Effect]| {
        let at = |n| run(base.clone(), &theta, effects.to_vec(), &drive, n);
        at(noise) - at(Noise::OFF)
    };
    let plain = part(&[]);
    for effects in [
        one("sensor-bias", "sensor", "magnitudes = { offset = 0.4 }"),
        one("sensor-drift", "sensor", "magnitudes = { rate = 0.01 }"),
        one("actuator-delay", "actuator", "magnitudes = { delay = 0.0 }"),
        one(
            "sensor-outliers",
            "sensor",
            "magnitudes = { probability = 0.0, scale = 1 }",
        ),
    ] {
        let moved = &part(&effects) - &plain;
        assert!(moved.iter().all(|d| d.abs() < 1e-12), "{effects:?}");
    }
}

/// Variance of one sample over many runs.
fn variance(base: Twin, theta: &[f64], effects: &[Effect], row: usize) -> f64 {
    let inputs = base.signals().inputs.len();
    let drive = Drive::new(0.5, Signal::ones((row + 1, inputs))).unwrap();
    let free = run(base.clone(), theta, effects.to_vec(), &drive, Noise::OFF)[[row, 0]];
    let n = 8000;
    let theta = held(theta, effects);
    let twin = augment(base, effects.to_vec()).unwrap();
    let square = |i| {
        let y = twin
            .simulate(&theta, &drive, Noise::new(5, "variance", i))
            .unwrap();
        (y[[row, 0]] - free).powi(2)
    };
    (0..n).map(square).sum::<f64>() / n as f64
}

/// Relative standard deviation of a variance from 8000 draws: √(2/8000) = 0.016; five of them.
#[test]
fn noises_add_in_quadrature() {
    let near = |got: f64, want: f64| (got / want - 1.0).abs() < 0.08;
    let noisier = one("sensor-noise", "sensor", "magnitudes = { std = 0.2 }");
    for (_, base, theta, _) in twins() {
        let twin = if theta.len() == 4 {
            0.15f64.powi(2)
        } else {
            0.0
        };
        let v = variance(base, &theta, &noisier, 0);
        assert!(near(v, twin + 0.04), "{v}");
    }
    // Sample 1 of the oscillator carries the noise of x1, which has none of its own; sample 2 carries Δt times the first
    // increment of x2, whose own standard deviation is Δt·√0.02.
    let shaken = one("process-noise", "x1", "magnitudes = { std = 0.3 }");
    let v = variance(Twin::new(VanDerPol), &NU, &shaken, 1);
    assert!(near(v, 0.09), "{v}");
    let shaken = one("process-noise", "x2", "magnitudes = { std = 0.07 }");
    let v = variance(Twin::new(VanDerPol), &NU, &shaken, 2);
    assert!(near(v, 0.25 * (0.25 * 0.02 + 0.0049)), "{v}");
}

/// Twice 150 samples × 200 runs at p = 0.05: 1500 hits, standard deviation 38; five of them.
#[test]
fn outliers_come_at_their_rate_and_size() {
    for (_, base, theta, drive) in twins() {
        let struck = one(
            "sensor-outliers",
            "sensor",
            "magnitudes = { probability = 0.05, scale = 3.0 }",
        );
        let (mut hits, mut square) = (0.0, 0.0);
        for i in 0..200 {
            let noise = Noise::new(6, "outliers", i);
            let plain = base.simulate(&theta, &drive, noise).unwrap();
            let y = run(base.clone(), &theta, struck.clone(), &drive, noise);
            for d in (&y - &plain).iter().filter(|d| **d != 0.0) {
                hits += 1.0;
                square += d * d;
            }
        }
        assert!((hits - 1500.0f64).abs() < 190.0, "{hits}");
        // √(2/1500) = 0.037; five of them.
        assert!(
            (square / hits / 9.0 - 1.0f64).abs() < 0.18,
            "{}",
            square / hits
        );
    }
}
