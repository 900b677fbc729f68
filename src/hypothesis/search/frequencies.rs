//! Frequencies that the residuals show: where a search for a periodic effect begins.

use super::model::Model;
use crate::hypothesis::limits::SEARCH;
use crate::likelihood::kalman::FilterError;
use crate::math::descending;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

/// Frequencies in Hz at which periodograms of the residuals peak: those of the innovations themselves, for what is added, and of
/// their products with the answer to each entry of θ, for what is modulated. Up to half the sampling rate, two a cycle of the record,
/// however long that is.
pub(crate) fn frequencies(model: &Model) -> Result<Vec<f64>, FilterError> {
    let Some(reference) = model.reference()? else {
        return Ok(vec![]);
    };
    let record = &model.problem.records[0];
    let (samples, dt) = (record.samples(), record.drive().dt());
    let p = record.outputs().ncols();
    let residual = reference.residual();
    let own = model
        .base
        .parameters()
        .iter()
        .filter(|q| q.role == crate::twin::Role::Parameter)
        .count();
    let mut series: Vec<Vec<f64>> = (0..p)
        .map(|i| (0..samples).map(|k| residual[2 * (k * p + i)]).collect())
        .collect();
    for j in 0..own {
        let column = reference.column(j);
        let product = |k: usize| {
            (0..2 * p)
                .map(|a| residual[2 * k * p + a] * column[2 * k * p + a])
                .sum()
        };
        series.push((0..samples).map(product).collect());
    }
    let mut found: Vec<f64> = vec![];
    for series in series {
        for bin in peaks(&series) {
            let frequency = bin as f64 / (2.0 * samples as f64 * dt);
            if !found.contains(&frequency) {
                found.push(frequency);
            }
        }
    }
    found.sort_unstable_by(f64::total_cmp);
    Ok(found)
}

/// Bins of the highest peaks of a series that is padded to twice its length; no slower than a cycle and a half of the record.
fn peaks(series: &[f64]) -> Vec<usize> {
    let n = series.len();
    let present: Vec<f64> = series.iter().copied().filter(|v| v.is_finite()).collect();
    let mean = present.iter().sum::<f64>() / present.len().max(1) as f64;
    let mut values: Vec<Complex<f64>> = (series.iter())
        .map(|v| Complex::new(if v.is_finite() { v - mean } else { 0.0 }, 0.0))
        .collect();
    values.resize(2 * n, Complex::new(0.0, 0.0));
    FftPlanner::new()
        .plan_fft_forward(2 * n)
        .process(&mut values);
    let power: Vec<f64> = values[..n].iter().map(Complex::norm_sqr).collect();
    let mut tops: Vec<usize> = (3..n.saturating_sub(1))
        .filter(|&i| power[i] >= power[i - 1] && power[i] >= power[i + 1])
        .collect();
    descending(&mut tops, |&i| power[i]);
    tops.truncate(SEARCH.peaks);
    tops
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wave_is_found_at_its_frequency() {
        let series: Vec<f64> = (0..1000)
            .map(|k| {
                let k = f64::from(k);
                (0.37 * k).sin() + 0.3 * (7.0 * k * k).sin()
            })
            .collect();
        let expected = 0.37 / std::f64::consts::TAU * 2000.0;
        assert!((peaks(&series)[0] as f64 - expected).abs() < 1.0);
    }
}
