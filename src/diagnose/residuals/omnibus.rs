//! Omnibus statistics of whiteness: they see gaps that no candidate imitates.

use crate::diagnose::residuals::correlation::{centred, correlation};
use crate::diagnose::thresholds::Thresholds;
use crate::likelihood::kalman::Filtered;
use crate::record::{Record, Signal};

/// The statistics, each larger the less white the innovations are; no one has a known distribution, and none is needed:
/// each is compared with simulations of the twin.
///
/// Returns for each output: the mean square, kurtosis, correlations of v and of v² over several lags, of v and v² with the predicted
/// output, of v with past inputs and with products of states and inputs, means in windows, the largest line of the
/// periodogram. Of the filtered states, the first `own` are the twin's.
pub(in crate::diagnose) fn omnibus(
    states: &[(Filtered, Signal)],
    records: &[Record],
    own: usize,
) -> Vec<f64> {
    let channels = (states.first()).map_or(0, |(f, _)| f.standardised.ncols());
    let mut all = Vec::new();
    let predicted: Vec<Signal> = (states.iter().zip(records))
        .map(|((f, _), record)| f.held_predictions(record.outputs()))
        .collect();
    for j in 0..channels {
        let mut sums: Vec<f64> = Vec::new();
        for (((f, states), record), predicted) in states.iter().zip(records).zip(&predicted) {
            let v: Vec<f64> = f.standardised.column(j).to_vec();
            let predicted = predicted.column(j).to_vec();
            let inputs: Vec<Vec<f64>> = (record.drive().inputs().columns().into_iter())
                .map(|u| u.to_vec())
                .collect();
            let mut one = of_channel(&v, &predicted, &inputs);
            one.extend(products(&v, states, record.drive().inputs(), own));
            if sums.is_empty() {
                sums = one;
            } else {
                sums.iter_mut().zip(one).for_each(|(s, o)| *s += o);
            }
        }
        all.extend(sums);
    }
    // On a scale on which chance is about normal.
    all.into_iter().map(|v: f64| v.max(0.0).sqrt()).collect()
}

fn of_channel(v: &[f64], predicted: &[f64], inputs: &[Vec<f64>]) -> Vec<f64> {
    let n = v.len() as f64;
    let squares: Vec<f64> = v.iter().map(|v| v * v).collect();
    let (v0, s0, p0) = (centred(v), centred(&squares), centred(predicted));
    let mean_square = squares.iter().sum::<f64>() / n;
    let fourth = squares.iter().map(|s| s * s).sum::<f64>() / n;
    let mean = v.iter().sum::<f64>() / n;
    let mut all = vec![
        0.5 * n * (mean_square.max(1e-12).ln()).powi(2),
        n / 24.0 * (fourth / mean_square.powi(2) - 3.0).powi(2),
        n * mean * mean,
    ];
    for signal in [&v0, &s0] {
        let squared: Vec<f64> = (1..=Thresholds::LAGS)
            .map(|lag| n * correlation(signal, signal, lag).powi(2))
            .collect();
        all.extend(Thresholds::LAG_SUMS.map(|k| squared[..k].iter().sum::<f64>()));
    }
    let bends: Vec<f64> = centred(&p0.iter().map(|p| p * p).collect::<Vec<_>>());
    for (a, b) in [(&v0, &p0), (&v0, &bends), (&s0, &p0)] {
        all.push(n * correlation(a, b, 0).powi(2));
    }
    for u in inputs {
        let u = centred(u);
        let changes: Vec<f64> = std::iter::once(0.0)
            .chain(u.windows(2).map(|w| w[1] - w[0]))
            .collect();
        for signal in [&u, &changes] {
            let sum: f64 = (1..=Thresholds::LAGS)
                .map(|lag| n * correlation(&v0, signal, lag).powi(2))
                .sum();
            all.push(sum);
        }
        all.push(n * correlation(&s0, &u, 1).powi(2));
    }
    let (mut means, mut squares_max) = (0.0f64, 0.0f64);
    for w in 0..Thresholds::OMNIBUS_WINDOWS {
        let (from, to) = (
            w * v.len() / Thresholds::OMNIBUS_WINDOWS,
            (w + 1) * v.len() / Thresholds::OMNIBUS_WINDOWS,
        );
        let m = (to - from).max(1) as f64;
        means = means.max((v[from..to].iter().sum::<f64>()).powi(2) / m);
        let excess = squares[from..to].iter().sum::<f64>() / m - 1.0;
        squares_max = squares_max.max(0.5 * m * excess * excess);
    }
    all.extend([means, squares_max, line(&v0)]);
    all
}

/// Correlations of v with the products of two states, or of a state and an input, one step before: what an interaction that
/// nobody listed leaves.
fn products(v: &[f64], states: &Signal, inputs: &Signal, own: usize) -> Vec<f64> {
    let n = v.len() as f64;
    let v = centred(v);
    let factors: Vec<Vec<f64>> = (states.columns().into_iter().take(own))
        .chain(inputs.columns())
        .map(|column| centred(&column.to_vec()))
        .collect();
    let mut all = Vec::new();
    for (i, a) in factors.iter().enumerate().take(own) {
        for b in &factors[i + 1..] {
            let product: Vec<f64> = a.iter().zip(b).map(|(a, b)| a * b).collect();
            all.push(n * correlation(&v, &centred(&product), 1).powi(2));
        }
    }
    all
}

/// The largest line of the periodogram over its mean.
fn line(v: &[f64]) -> f64 {
    let n = v.len();
    let powers: Vec<f64> = (1..=Thresholds::OMNIBUS_FREQUENCIES.min(n / 2))
        .map(|f| {
            let step = std::f64::consts::TAU * f as f64 / n as f64;
            let (mut c, mut s) = (0.0, 0.0);
            for (k, v) in v.iter().enumerate() {
                let (sin, cos) = (step * k as f64).sin_cos();
                c += v * cos;
                s += v * sin;
            }
            (c * c + s * s) / n as f64
        })
        .collect();
    powers.iter().fold(0.0, |a: f64, p| a.max(*p))
}
