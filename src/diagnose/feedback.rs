//! Inputs that a controller makes of the outputs.
//!
//! In a closed loop the input of a row holds the measurement noise of that row: u_k = −K·(y_k − reference). A function of u at a sensor then
//! explains that noise, and passes for a gap. Of each input and output
//!
//! ```text
//! u_k = a + Σ b_l·u_{k−l} + c·e_k + Σ d_l·e_{k−l},   l = 1 … 4        e: innovations of the output
//! ```
//!
//! is fitted. The input holds the noise where c is clear. A controller is told from an input that acts on a sensor by itself by the innovations
//! of rows before, which say nothing of the future of an input that nothing feeds back to: all d together must be clear as well. Each is
//! judged by n·ln(RSS₀/RSS), about χ² where it is zero.

use super::thresholds::THRESHOLDS;
use crate::hypothesis::term::Term;
use crate::likelihood::kalman::Filtered;
use crate::record::Record;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Rows before that are looked at: twice hardly shows more of a state that a few rows tell; half misses a derivative's.
const BEFORE: usize = 4;

/// Names of inputs that react to an output of the same row.
pub(super) fn reacting(
    filtered: &[Filtered],
    records: &[Record],
    inputs: &[String],
) -> Vec<String> {
    let outputs = records[0].outputs().ncols();
    let reacts = |i: usize| (0..outputs).any(|j| responds(filtered, records, i, j));
    (inputs.iter().enumerate())
        .filter(|(i, _)| reacts(*i))
        .map(|(_, name)| name.clone())
        .collect()
}

/// Returns whether input `i` reacts to output `j`.
fn responds(filtered: &[Filtered], records: &[Record], i: usize, j: usize) -> bool {
    let (mut rows, mut inputs) = (vec![], vec![]);
    for (filtered, record) in filtered.iter().zip(records) {
        let u = record.drive().inputs().column(i);
        let e = filtered.innovations.column(j);
        for k in BEFORE..record.samples() {
            // A missing value has no innovation.
            if (0..=BEFORE).all(|l| record.outputs()[[k - l, j]].is_finite()) {
                rows.push(1.0);
                rows.extend((1..=BEFORE).map(|l| u[k - l]));
                rows.extend((0..=BEFORE).map(|l| e[k - l]));
                inputs.push(u[k]);
            }
        }
    }
    let (own, all) = (BEFORE + 1, 2 * BEFORE + 2);
    let x = DMatrix::from_row_iterator(inputs.len(), all, rows);
    let y = DVector::from_vec(inputs);
    let rests = [own, own + 1, all].map(|columns| rest(&x.columns(0, columns).into_owned(), &y));
    let [Some(own), Some(noise), Some(before)] = rests else {
        return false;
    };
    let is_clear = |without: f64, with: f64, freedom: usize| {
        let limit = ChiSquared::new(freedom as f64)
            .map(|chi| chi.inverse_cdf(1.0 - THRESHOLDS.feedback_level));
        limit.is_ok_and(|limit| y.len() as f64 * (without / with).ln() > limit)
    };
    is_clear(own, noise, 1) && is_clear(noise, before, BEFORE)
}

/// Sum of squares that a linear regression leaves; `None` where columns depend on each other, or there are too few rows.
fn rest(x: &DMatrix<f64>, y: &DVector<f64>) -> Option<f64> {
    if y.len() <= 2 * x.ncols() {
        return None;
    }
    let b = (x.transpose() * x).cholesky()?.solve(&(x.transpose() * y));
    // An input that follows an output exactly leaves rounding errors.
    let exact = y.norm_squared() * f64::EPSILON;
    Some((y - x * b).norm_squared().max(exact))
}

/// Returns whether a term is a function of a reacting input at a sensor.
pub(super) fn explains_noise(term: &Term, is_sensor: bool, reacting: &[String]) -> bool {
    let of_input = |variable: &str| {
        let mut words = variable.split(|c: char| !(c.is_alphanumeric() || c == '_'));
        words.any(|word| reacting.iter().any(|name| name == word))
    };
    is_sensor && term.variables.iter().any(|(name, ..)| of_input(name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::likelihood::kalman::{FilterSettings, Kalman};
    use crate::record::{Drive, Signal};
    use crate::twin::Noise;
    use crate::twins::CascadedTanks;

    /// Tanks whose pump is set by `pump` from the level that is read, the reference and the row; their sensor also shows a share of the pump.
    fn reacts(pump: impl Fn(f64, f64) -> f64, crosstalk: f64, seed: u64) -> bool {
        let mut source = Noise::new(seed, "loop", 0).source("all");
        let (mut h, mut inputs, mut outputs) = ([2.0_f64, 2.0], vec![], vec![]);
        let theta = [0.6, 0.6, 0.6, 1.0];
        let mut reference = 2.0;
        for k in 0..300 {
            if k % 30 == 0 {
                reference = 1.0 + 3.0 * source.uniform();
            }
            let level = h[1] + 0.15 * source.normal();
            let u = pump(level, reference).clamp(0.0, 5.0);
            inputs.push(u);
            outputs.push(level + crosstalk * u);
            let [a, b] = h.map(|v| v.max(0.0).sqrt());
            h[0] += 0.5 * (-theta[0] * a + theta[3] * u) + 0.1 * source.normal();
            h[1] += 0.5 * (theta[1] * a - theta[2] * b) + 0.1 * source.normal();
            h = h.map(|v| v.clamp(0.0, 10.0));
        }
        let column = |values| Signal::from_shape_vec((300, 1), values).unwrap();
        let drive = Drive::new(0.5, column(inputs)).unwrap();
        let record = Record::new(drive, column(outputs)).unwrap();
        let settings = FilterSettings::default();
        let kalman = Kalman::new(CascadedTanks, &record, &settings).unwrap();
        let filtered = kalman.filter(&theta).unwrap();
        !reacting(&[filtered], &[record], &["u".into()]).is_empty()
    }

    #[test]
    fn a_controller_is_told_from_an_input_that_acts_on_a_sensor() {
        for seed in 0..5 {
            assert!(reacts(
                |y, reference| 1.0 + 1.5 * (reference - y),
                0.0,
                seed
            ));
            assert!(!reacts(|_, reference| reference, 0.0, seed));
            assert!(!reacts(|_, reference| reference, 0.3, seed));
        }
    }
}
