//! Likelihood of outputs with independent normal noise of known kind about a known mean: exact, from one run.
//!
//! ```text
//! y = μ + Σ d_i + v      d_i ← a_i·d_i + σ_i·w,  d_i normal at the start      v, w ~ N, white;  a Kalman filter for each output
//! ```

use super::predictor::floors;
use crate::likelihood::kalman::{FilterError, Filtered};
use crate::record::Record;
use crate::twin::KnownNoise;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// Innovations of a record and their densities.
pub(super) fn filtered(known: &KnownNoise, record: &Record) -> Result<Filtered, FilterError> {
    let outputs = record.outputs();
    let (samples, p) = outputs.dim();
    let bad = |k: usize| known.mean.row(k).iter().any(|v| !v.is_finite());
    if known.mean.dim() != (samples, p) || (0..samples).any(bad) {
        let at = (0..samples.min(known.mean.nrows())).find(|&k| bad(k));
        let at = record.drive().time(at.unwrap_or(0));
        return Err(FilterError::Diverged { at });
    }
    let mut filtered = Filtered::new(samples, p, None);
    for (j, floor) in floors(record).into_iter().enumerate() {
        let parts = || known.parts.iter().filter(move |part| part.output == j);
        let white: f64 = parts()
            .filter(|part| part.memory.is_none())
            .map(|part| part.level.powi(2))
            .sum();
        let kept: Vec<[f64; 3]> = parts()
            .filter_map(|part| Some([part.memory?, part.level.powi(2), part.start.powi(2)]))
            .collect();
        let white = white.max(floor);
        let mut d = DVector::<f64>::zeros(kept.len());
        let starts = DVector::from_iterator(kept.len(), kept.iter().map(|[.., start]| *start));
        let mut spread = DMatrix::from_diagonal(&starts);
        for k in 0..samples {
            let y = outputs[[k, j]];
            filtered.covariances[[k, j, j]] = 1.0;
            if !y.is_nan() {
                let along = spread.column_sum();
                let variance = white + along.sum();
                let e = y - known.mean[[k, j]] - d.sum();
                d += &along * (e / variance);
                spread -= &along * along.transpose() / variance;
                filtered.innovations[[k, j]] = e;
                filtered.covariances[[k, j, j]] = variance;
                filtered.standardised[[k, j]] = e / variance.sqrt();
                filtered.log_densities[k] -= 0.5 * (e * e / variance + (TAU * variance).ln());
            }
            for (i, [a, level, _]) in kept.iter().enumerate() {
                d[i] *= a;
                spread.row_mut(i).scale_mut(*a);
                spread.column_mut(i).scale_mut(*a);
                spread[(i, i)] += level;
            }
        }
    }
    filtered.log_likelihood = filtered.log_densities.iter().sum();
    Ok(filtered)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Drive, Signal};
    use crate::twin::{Noise, NoisePart};

    /// Checks innovations and densities against the normal density of the whole record, missing rows left out.
    #[test]
    fn the_density_is_that_of_the_whole_record() {
        let n = 40;
        let part = |level, memory, start| NoisePart {
            output: 0,
            level,
            memory,
            start,
            source: format!("{level}"),
        };
        let parts = vec![
            part(0.1, None, 0.0),
            part(0.2, Some(0.9), 0.3),
            part(0.05, Some(0.4), 0.0),
        ];
        let mean = Signal::from_shape_fn((n, 1), |(k, _)| (0.3 * k as f64).sin());
        let known = KnownNoise {
            mean: mean.clone(),
            parts,
        };
        let mut outputs = mean.clone();
        for part in &known.parts {
            part.add(Noise::new(1, "test", 0), &mut outputs);
        }
        outputs[[5, 0]] = f64::NAN;
        let drive = Drive::autonomous(0.1, n).unwrap();
        let record = Record::new(drive, outputs.clone()).unwrap();
        let found = filtered(&known, &record).unwrap();

        // d_k = aᵏ·d_0 + Σ_{l<k} a^{k−1−l}·σ·w_l
        let there: Vec<usize> = (0..n).filter(|k| *k != 5).collect();
        let covariance = DMatrix::from_fn(there.len(), there.len(), |i, j| {
            let (s, t) = (there[i].min(there[j]), there[i].max(there[j]));
            let kept = |a: f64, level: f64| -> f64 {
                let terms = (0..s).map(|l| a.powi((s - 1 - l) as i32) * a.powi((t - 1 - l) as i32));
                level.powi(2) * terms.sum::<f64>()
            };
            let white = if s == t { 0.01 } else { 0.0 };
            let start = 0.3_f64.powi(2) * 0.9_f64.powi((s + t) as i32);
            white + start + kept(0.9, 0.2) + kept(0.4, 0.05)
        });
        let e = DVector::from_iterator(
            there.len(),
            there.iter().map(|&k| outputs[[k, 0]] - mean[[k, 0]]),
        );
        let root = covariance.cholesky().unwrap();
        let log_det = 2.0 * root.l().diagonal().map(f64::ln).sum();
        let expected = -0.5 * (e.dot(&root.solve(&e)) + log_det + there.len() as f64 * TAU.ln());
        assert!((found.log_likelihood - expected).abs() < 1e-9, "{expected}");
        assert_eq!(found.standardised[[5, 0]], 0.0);
    }
}
