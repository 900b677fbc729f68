//! ARMAX features of records whose process is known.

use super::*;
use crate::feature::testing::tank;
use crate::twin::Noise;

const ORDERS: Armax = Armax {
    outputs: 1,
    inputs: 1,
    noise: 1,
};

/// A tank with `inputs` inputs: one state, process and measurement noise, so ARMAX(1, 1, 1) exactly.
fn record(inputs: usize, samples: usize) -> (Twin, Drive, Signal) {
    let twin = Twin::new(tank(inputs));
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

/// The estimate of models of known processes.
mod estimates {
    use super::super::*;
    use crate::twin::Noise;

    const A: [f64; 2] = [1.5, -0.7];
    const B: [f64; 2] = [1.0, 0.5];
    const C: [f64; 2] = [0.6, 0.3];

    /// An ARMAX(2, 2, 2) record: output and input.
    fn record(samples: usize, seed: u64) -> (Vec<f64>, Vec<f64>) {
        let noise = Noise::new(seed, "armax", 0);
        let (mut input, mut innovation) = (noise.source("u"), noise.source("e"));
        let mut draw = |n: usize| -> Vec<f64> { (0..n).map(|_| input.normal()).collect() };
        let u = draw(samples);
        let e: Vec<f64> = (0..samples).map(|_| 0.5 * innovation.normal()).collect();
        let mut y = vec![0.0; samples];
        for t in 2..samples {
            let sum = |l: [f64; 2], x: &[f64]| l[0] * x[t - 1] + l[1] * x[t - 2];
            y[t] = sum(A, &y) + sum(B, &u) + e[t] + sum(C, &e);
        }
        (y, u)
    }

    fn orders(r: usize) -> Orders {
        let (p, q, inputs) = (2, 2, 1);
        Orders { p, q, r, inputs }
    }

    /// Mean over records within four of its standard errors of the truth, up to the bias of order 1/N; that of ARX of
    /// the same orders is not.
    #[test]
    fn coefficients_are_those_of_the_process_and_arx_is_biased() {
        let (records, truth) = (60u32, [A, B, C].concat());
        let found: Vec<_> = (0..records)
            .map(|seed| {
                let (y, u) = record(1000, seed.into());
                let model = estimate(&y, std::slice::from_ref(&u), orders(2)).unwrap();
                let arx = regress(lagged(&y, 2, &[u], 2), 2).unwrap().coefficients;
                (model, arx)
            })
            .collect();
        let n = f64::from(records);
        for (i, truth) in truth.into_iter().enumerate() {
            let of = |model: &ArmaxModel| model.coefficients[i] - truth;
            let mean = found.iter().map(|(m, _)| of(m)).sum::<f64>() / n;
            let variance = found
                .iter()
                .map(|(m, _)| (of(m) - mean).powi(2))
                .sum::<f64>()
                / n;
            let error = (variance / n).sqrt();
            assert!(mean.abs() < 4.0 * error + 3e-3, "{i}: {mean} of {error}");
            if i < 4 {
                let bias = found.iter().map(|(_, arx)| arx[i] - truth).sum::<f64>() / n;
                // u(t − 1) is independent of all other regressors: b₁ has no bias.
                assert!(
                    i == 2 || bias.abs() > 10.0 * error,
                    "{i}: {bias} of {error}"
                );
            }
        }
        let innovation = found.iter().map(|(m, _)| m.innovation).sum::<f64>() / n;
        assert!((innovation / 0.5 - 1.0).abs() < 0.01, "{innovation}");
    }

    /// A refined estimate varies less than that of the two regressions.
    #[test]
    fn refinement_pays() {
        let (mut before, mut after) = (0.0, 0.0);
        for seed in 0..60 {
            let (y, u) = record(300, seed);
            let inputs = [u];
            let series = ArmaxSeries::new(&y, &inputs, orders(2));
            let error = |c: &[f64]| (c[4] - C[0]).powi(2) + (c[5] - C[1]).powi(2);
            before += error(&series.by_regressions().unwrap());
            after += error(&estimate(&y, &inputs, orders(2)).unwrap().coefficients);
        }
        assert!(after < 0.8 * before, "{after} after {before}");
    }

    #[test]
    fn zeros_are_drawn_inside_and_no_further() {
        assert!(is_invertible(vec![0.9]) && !is_invertible(vec![-1.0]));
        // Zeros 0.5 and 2.
        assert!(!is_invertible(vec![-2.5, 1.0]) && !is_invertible(vec![f64::NAN]));
        let mut c = [-2.5, 1.0];
        make_invertible(&mut c);
        let value = |z: f64| z * z + c[0] * z + c[1];
        let largest = ARMAX.largest_zero;
        assert!(value(largest).abs() < 1e-9 && value(0.25 * largest).abs() < 1e-9);
        let mut inside = [-0.9, 0.2];
        make_invertible(&mut inside);
        assert_eq!(inside, [-0.9, 0.2]);
    }
}
