//! Each row of a record predicted from the rows before it, as runs of the twin say.
//!
//! ```text
//! e = y − μ                         μ: mean of the runs
//! z_k = (e_{k−1}, …, e_{k−L})       ê_k = Bᵀ_k z_k            least squares over the runs, for each row anew
//! v_k = e_k − ê_k ~ N(0, S_k)       S_k = Σ_k·(1 + 1/M + zᵀA⁻¹z),   A = Z Zᵀ
//! ```
//!
//! Σ is the covariance that the runs' own residuals have, over their degrees of freedom. The bracket is what M runs leave
//! unknown about the mean and B: a record far from all runs is predicted with less confidence, not with more.
//!
//! About linear dynamics around the mean run this is what a Kalman filter does, its gain read off the runs, row by row; what is
//! not linear within the scatter of the runs widens Σ. Rare large errors make the density a Student's (`tail.rs`).

use super::row::{RowPrediction, row};
use super::runs::Ensemble;
use super::tail::Tail;
use crate::likelihood::kalman::Filtered;
use crate::math::quantile;
use crate::record::{Record, Signal};
use nalgebra::{DMatrix, DVector};
use ndarray::Array1;

/// Rows before a row that it is predicted from.
const LAGS: usize = 4;
/// Runs for each number that a row is predicted from.
const RUNS_EACH: usize = 6;
/// Independent noise that everything measured has, as a share of the output's size.
const FLOOR: f64 = 1e-5;
/// The same as a share of what most rows have: a known start or a clipped output is not believed to the last bit.
const LEAST: f64 = 0.3;
const MOST_ROWS: f64 = 0.9;
/// Rows with less than this share of the largest variance are clipped, or the start.
const ALIVE: f64 = 1e-3;

/// Predictor of all rows at one θ.
#[derive(Debug, Clone)]
pub(crate) struct Predictor {
    mean: Signal,
    runs: f64,
    rows: Vec<RowPrediction>,
    tail: Tail,
}

impl Predictor {
    /// Fits all rows to the runs; the record gives the scale of each output, what it is rounded to, and which cells are missing.
    pub(crate) fn new(ensemble: &Ensemble, record: &Record) -> Self {
        let outputs = record.outputs();
        let p = ensemble.outputs();
        let m = ensemble.runs;
        let lags = LAGS.min(m / RUNS_EACH / p).max(1);
        let floors = floors(record);
        let mut rows: Vec<RowPrediction> = (0..ensemble.mean.nrows())
            .map(|k| {
                let past = (1..=lags.min(k)).flat_map(|lag| (0..p).map(move |j| (k - lag, j)));
                let known = past.filter(|&(k, j)| !outputs[[k, j]].is_nan()).collect();
                row(ensemble, k, known, &floors)
            })
            .collect();
        let least: Vec<f64> = (0..p).map(|j| least(&rows, j)).collect();
        let tail = Tail::of(ensemble, &rows, &least);
        for row in &mut rows {
            for (j, least) in least.iter().enumerate() {
                row.covariance[(j, j)] = row.covariance[(j, j)].max(*least);
            }
        }
        Self {
            mean: ensemble.mean.clone(),
            runs: m as f64,
            rows,
            tail,
        }
    }

    /// Innovations of a record whose missing cells are those that the predictor was made for.
    pub fn filter(&self, outputs: &Signal) -> Filtered {
        let (samples, p) = outputs.dim();
        let errors = outputs - &self.mean;
        let mut filtered = Filtered::new(samples, p, None);
        for (k, row) in self.rows.iter().enumerate() {
            let past = row.past.iter().map(|&cell| errors[cell]);
            let z = DVector::from_iterator(row.past.len(), past);
            let mut e = DVector::from_fn(p, |j, _| errors[[k, j]]) - &row.weights * &z;
            let wide = 1.0 + 1.0 / self.runs + (&row.whitening * &z).norm_squared();
            let mut covariance = &row.covariance * wide;
            let missing = |j: usize| errors[[k, j]].is_nan();
            for j in (0..p).filter(|&j| missing(j)) {
                e[j] = 0.0;
                covariance.row_mut(j).fill(0.0);
                covariance.column_mut(j).fill(0.0);
                covariance[(j, j)] = 1.0;
            }
            let (v, log_determinant) = standardised(&covariance, &e);
            for i in 0..p {
                filtered.innovations[[k, i]] = e[i];
                filtered.standardised[[k, i]] = v[i];
                for j in 0..p {
                    filtered.covariances[[k, i, j]] = covariance[(i, j)];
                }
            }
            let there = (0..p).filter(|&j| !missing(j)).map(|j| v[j]);
            let there = DVector::from_vec(there.collect());
            let density = self.tail.log_density(&there) - 0.5 * log_determinant;
            filtered.log_densities[k] = density;
            filtered.log_likelihood += density;
        }
        filtered
    }
}

/// Least variance of each output: independent noise that everything measured has, and rounding.
pub(super) fn floors(record: &Record) -> Vec<f64> {
    (record.outputs().columns().into_iter().zip(record.cells()))
        .map(|(y, cell)| {
            let y: Array1<f64> = y.iter().copied().filter(|v| !v.is_nan()).collect();
            let size = y
                .std(0.0)
                .max(1e-3 * y.iter().fold(0.0, |a, v| v.abs().max(a)));
            (FLOOR * size).max(1e-150).powi(2).max(*cell)
        })
        .collect()
}

/// Least variance of output j in a row.
fn least(rows: &[RowPrediction], j: usize) -> f64 {
    let all = || rows.iter().map(|row| row.covariance[(j, j)]);
    let largest = all().fold(0.0, f64::max);
    let alive: Vec<f64> = all().filter(|s| *s >= ALIVE * largest).collect();
    LEAST * LEAST * quantile(&alive, MOST_ROWS).unwrap_or(0.0)
}

/// C⁻¹e and log det S of S = C·Cᵀ.
pub(crate) fn standardised(s: &DMatrix<f64>, e: &DVector<f64>) -> (DVector<f64>, f64) {
    let p = e.len();
    if p == 1 {
        return (e / s[(0, 0)].sqrt(), s[(0, 0)].ln());
    }
    match s.clone().cholesky() {
        Some(c) => {
            let l = c.l_dirty();
            let mut v = e.clone();
            l.solve_lower_triangular_mut(&mut v);
            let log: f64 = (0..p).map(|i| 2.0 * l[(i, i)].ln()).sum();
            (v, log)
        }
        // Rounding took the smallest root away: outputs on their own.
        None => (
            DVector::from_fn(p, |i, _| e[i] / s[(i, i)].sqrt()),
            (0..p).map(|i| s[(i, i)].ln()).sum(),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::likelihood::kalman::{FilterSettings, Kalman};
    use crate::record::{Drive, Record};
    use crate::twin::{DigitalTwin, Noise};
    use crate::twins::CascadedTanks;

    /// Checks the ensemble's prediction against a filter's, which is the best.
    #[test]
    fn an_ensemble_predicts_about_as_well_as_a_filter() {
        let theta = [0.6, 0.5, 0.55, 1.0];
        let inputs =
            Signal::from_shape_fn((400, 1), |(k, _)| [2.6, 0.4, 2.0, 1.2, 1.7][k / 30 % 5]);
        let drive = Drive::new(0.5, inputs).unwrap();
        let (mut lost, mut square) = (0.0, 0.0);
        for seed in 0..5 {
            let outputs = CascadedTanks
                .simulate(&theta, &drive, Noise::new(3, "t", seed))
                .unwrap();
            let record = Record::new(drive.clone(), outputs).unwrap();
            let settings = FilterSettings::default();
            let kalman = Kalman::new(CascadedTanks, &record, &settings).unwrap();
            let best = kalman.filter(&theta).unwrap();
            let ours = {
                let ensemble = Ensemble::new(&CascadedTanks, &theta, record.drive()).unwrap();
                Predictor::new(&ensemble, &record).filter(record.outputs())
            };
            lost += (best.log_likelihood - ours.log_likelihood) / 5.0;
            square += ours.standardised.mapv(|v| v * v).mean().unwrap() / 5.0;
        }
        println!("{lost} nats, mean square {square}");
        assert!(lost < 25.0, "{lost} nats");
        assert!((square - 1.0).abs() < 0.12, "{square}");
    }

    /// Missing outputs have no part in a density, and the others are predicted about as well as a filter does.
    #[test]
    fn missing_outputs_are_left_out() {
        let theta = [0.6, 0.5, 0.55, 1.0];
        let inputs =
            Signal::from_shape_fn((400, 1), |(k, _)| [2.6, 0.4, 2.0, 1.2, 1.7][k / 30 % 5]);
        let drive = Drive::new(0.5, inputs).unwrap();
        let mut outputs = CascadedTanks
            .simulate(&theta, &drive, Noise::new(3, "t", 1))
            .unwrap();
        for k in (0..400).filter(|k| k % 7 == 3 || (100..120).contains(k)) {
            outputs[[k, 0]] = f64::NAN;
        }
        let record = Record::new(drive, outputs).unwrap();
        let settings = FilterSettings::default();
        let best = Kalman::new(CascadedTanks, &record, &settings)
            .and_then(|kalman| kalman.filter(&theta))
            .unwrap();
        let ours = crate::likelihood::ensemble::predictor(&CascadedTanks, &theta, &record)
            .unwrap()
            .filter(record.outputs());
        let lost = best.log_likelihood - ours.log_likelihood;
        assert!((-5.0..30.0).contains(&lost), "{lost} nats");
        for (k, y) in record.outputs().column(0).iter().enumerate() {
            let (v, density) = (ours.standardised[[k, 0]], ours.log_densities[k]);
            assert_eq!(y.is_nan(), (v, density) == (0.0, 0.0), "row {k}");
            assert!(v.is_finite());
        }
        let held = ours.held_predictions(record.outputs());
        assert!(held.iter().all(|y| y.is_finite()));
    }
}
