//! ARMAX features of records whose process is known.

use super::*;
use crate::feature::testing::Tank;
use crate::twin::Noise;

const ORDERS: Armax = Armax {
    outputs: 1,
    inputs: 1,
    noise: 1,
};

/// A tank with `inputs` inputs: one state, process and measurement noise, so ARMAX(1, 1, 1) exactly.
fn record(inputs: usize, samples: usize) -> (Twin, Drive, Signal) {
    let twin = Twin::new(Tank(inputs));
    let levels = Signal::from_shape_fn((samples, inputs), |(k, _)| f64::from(k / 20 % 2 == 0));
    let drive = Drive::new(0.1, levels).unwrap();
    let y = twin
        .simulate(&[0.5], &drive, Noise::new(4, "armax", 0))
        .unwrap();
    (twin, drive, y)
}

fn features(recipe: &Armax, inputs: usize, samples: usize) -> Result<Vec<f64>, FeatureError> {
    let (twin, drive, y) = record(inputs, samples);
    recipe.bind(&twin)?.extract(&drive, &y)
}

/// x ← (1 − k·Δt)·x + Δt·u + w, y = x + v: the zero of C follows from the levels of w and v (spectral factorisation).
#[test]
fn a_noisy_state_seen_through_noise_is_armax() {
    let x = features(&ORDERS, 1, 20_000).unwrap();
    let (a, w, v) = (0.95f64, 0.02f64.powi(2), 0.05f64.powi(2));
    // c + 1/c = −(w + v·(1 + a²))/(a·v), innovation variance −a·v/c.
    let half = 0.5 * (w + v * (1.0 + a * a)) / (a * v);
    let c = (half * half - 1.0).sqrt() - half;
    assert!((x[0] - a).abs() < 0.01, "{x:?}");
    assert!((x[1] - 0.1).abs() < 0.005, "{x:?}");
    assert!((x[2] - c).abs() < 0.04, "{c}: {x:?}");
    assert!((x[3] - 0.5 * (-a * v / c).ln()).abs() < 0.02, "{x:?}");
}

#[test]
fn without_inputs_it_is_arma() {
    let none = Armax {
        inputs: 0,
        ..ORDERS
    };
    let x = features(&none, 0, 20_000).unwrap();
    assert_eq!(x.len(), 3);
    assert!((x[0] - 0.95).abs() < 0.02, "{x:?}");
    assert_eq!(features(&none, 1, 300).unwrap().len(), 3);
    let error = features(&ORDERS, 0, 300).unwrap_err().to_string();
    assert!(error.contains("take inputs = 0"), "{error}");
}

#[test]
fn units_of_the_output_scale_b_and_shift_the_noise() {
    let (twin, drive, y) = record(1, 300);
    let map = ORDERS.bind(&twin).unwrap();
    let x = map.extract(&drive, &y).unwrap();
    assert_eq!(x, map.extract(&drive, &y).unwrap(), "the same bits again");
    let scaled = map.extract(&drive, &(y * 1000.0)).unwrap();
    let expected = [x[0], 1000.0 * x[1], x[2], x[3] + 1000f64.ln()];
    let near = |(a, b): (&f64, &f64)| (a / b - 1.0).abs() < 1e-9;
    assert!(scaled.iter().zip(&expected).all(near), "{scaled:?}");
}

/// Neither zeros that cancel nor a record without noise break it, and a small change has a small effect.
#[test]
fn features_are_finite_and_continuous() {
    let (twin, drive, y) = record(1, 300);
    let high = Armax {
        outputs: 4,
        inputs: 4,
        noise: 4,
    };
    let map = high.bind(&twin).unwrap();
    let x = map.extract(&drive, &y).unwrap();
    let near = map
        .extract(&drive, &y.mapv(|v| v + 1e-9 * v.sin()))
        .unwrap();
    let moved = (x.iter().zip(&near)).map(|(a, b)| (a - b).abs());
    assert!(moved.fold(0.0, f64::max) < 1e-4);
    let silent = twin.simulate(&[0.5], &drive, Noise::OFF).unwrap();
    let x = map.extract(&drive, &silent).unwrap();
    assert!(x.iter().all(|v| v.is_finite()), "{x:?}");
}

#[test]
fn what_cannot_be_fitted_is_named() {
    // A long regression of 2 lags of 2 signals, two equations each.
    assert!(features(&ORDERS, 1, 10).is_ok());
    let short = features(&ORDERS, 1, 9).unwrap_err().to_string();
    assert!(
        short.contains("9 samples") && short.contains("need 10"),
        "{short}"
    );
    let quiet = Armax { noise: 0, ..ORDERS };
    let error = features(&quiet, 1, 300).unwrap_err().to_string();
    assert!(
        error.contains("noise = 0") && error.contains("arx"),
        "{error}"
    );
    let (twin, drive, y) = record(1, 50);
    let flat = ORDERS.bind(&twin).unwrap().extract(&drive, &(y * 0.0));
    assert!(
        flat.unwrap_err()
            .to_string()
            .contains("output 1 is constant")
    );
}
