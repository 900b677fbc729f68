//! Inputs that a controller makes of the outputs.
//!
//! In a closed loop the input of a row holds the measurement noise of that row: u_k = −K·(y_k − reference). A function of u at a sensor, or of
//! its lag or play, then explains that noise, and passes for a gap. Of each input and output
//!
//! ```text
//! u_k = a + Σ b_l·u_{k−l} + c·e_k + Σ d_m·y_{k−m},   l = 1 … 32,  m = 1 … 4        e: innovation of the output
//! ```
//!
//! is fitted. The input holds the noise where c is clear. A controller is told from an input that acts on a sensor by itself by the outputs of
//! rows before, which say nothing of the future of an input that nothing feeds back to, beyond what its own past says: all d together must be
//! clear as well. Each is judged by n·ln(RSS₀/RSS), about χ² where it is zero. Rows in which the reference jumps are left out: a few would
//! hide all others.
//!
//! Source: Caines & Chan, "Feedback between stationary stochastic processes" (1975); Granger (1969).

use super::thresholds::THRESHOLDS;
use crate::hypothesis::basis::Of;
use crate::hypothesis::entry::Entry;
use crate::hypothesis::term::{Part, Term};
use crate::likelihood::kalman::Filtered;
use crate::math::LeastSquares;
use crate::record::Record;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Inputs that react to an output of the same row.
pub(super) fn reacting(filtered: &[Filtered], records: &[Record]) -> Vec<usize> {
    let outputs = records[0].outputs().ncols();
    let reacts = |i: &usize| (0..outputs).any(|j| responds(filtered, records, *i, j));
    (0..records[0].drive().inputs().ncols())
        .filter(reacts)
        .collect()
}

/// Returns whether input `i` reacts to output `j`.
fn responds(filtered: &[Filtered], records: &[Record], i: usize, j: usize) -> bool {
    let before = THRESHOLDS.feedback_before;
    let shortest = records.iter().map(Record::samples).min().unwrap_or(0);
    let own = (shortest / THRESHOLDS.feedback_part).clamp(before, THRESHOLDS.feedback_own);
    let (mut rows, mut inputs) = (vec![], vec![]);
    for (filtered, record) in filtered.iter().zip(records) {
        let u = record.drive().inputs().column(i);
        let y = record.outputs().column(j);
        let e = filtered.innovations.column(j);
        for k in own..record.samples() {
            // A missing value has no innovation.
            if (0..=before).all(|m| y[k - m].is_finite()) {
                rows.push(1.0);
                rows.extend((1..=own).map(|l| u[k - l]));
                rows.push(e[k]);
                rows.extend((1..=before).map(|m| y[k - m]));
                inputs.push(u[k]);
            }
        }
    }
    let all = 1 + own + 1 + before;
    let mut x = DMatrix::from_row_iterator(inputs.len(), all, rows);
    let mut u = DVector::from_vec(inputs);
    for _ in 0..THRESHOLDS.feedback_rounds {
        let Some(rest) = regression(&x, &u) else {
            return false;
        };
        let kept = without_jumps(&rest);
        (x, u) = (x.select_rows(&kept), u.select_rows(&kept));
    }
    let square = |columns| {
        let rest = regression(&x.columns(0, columns).into_owned(), &u)?;
        let least = THRESHOLDS.feedback_rest.powi(2) * u.norm_squared();
        Some(rest.iter().map(|r| r * r).sum::<f64>().max(least))
    };
    let [Some(alone), Some(noise), Some(past)] = [1 + own, 2 + own, all].map(square) else {
        return false;
    };
    let is_clear = |without: f64, with: f64, freedom: usize| {
        let limit = ChiSquared::new(freedom as f64)
            .map(|chi| chi.inverse_cdf(1.0 - THRESHOLDS.feedback_level));
        limit.is_ok_and(|limit| u.len() as f64 * (without / with).ln() > limit)
    };
    is_clear(alone, noise, 1) && is_clear(noise, past, before)
}

/// Rest that a linear regression leaves; `None` where there are too few rows.
fn regression(x: &DMatrix<f64>, u: &DVector<f64>) -> Option<Vec<f64>> {
    if u.len() <= 2 * x.ncols() {
        return None;
    }
    let squares = LeastSquares::with_gram(x, &x.tr_mul(x)).ok()?;
    Some(squares.solve(u.as_slice()).ok()?.residual)
}

/// Rows of a rest but for those in which it jumps.
fn without_jumps(rest: &[f64]) -> Vec<usize> {
    let mut sizes: Vec<f64> = rest.iter().map(|r| r.abs()).collect();
    let middle = sizes.len() / 2;
    let limit = THRESHOLDS.feedback_jump * *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
    (0..rest.len())
        .filter(|&k| rest[k].abs() <= limit)
        .collect()
}

/// Returns whether a term is a function of a reacting input, or of its trace, at a sensor.
pub(super) fn explains_noise(term: &Term, reacting: &[usize]) -> bool {
    match &term.part {
        Part::Function(function) => {
            let is_reacting = matches!(function.of, Of::Input(i) if reacting.contains(&i));
            is_reacting && matches!(function.entry, Entry::Sensor(_))
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::{DiagnoseSettings, Verdict, diagnose};
    use crate::likelihood::kalman::{FilterSettings, Kalman};
    use crate::progress::Progress;
    use crate::record::{Drive, Signal};
    use crate::study::Study;
    use crate::twin::fixture::OneState;
    use crate::twin::{Noise, Parameter};
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
        reacting(&[filtered], &[record]) == [0]
    }

    /// A room whose heater is set by a thermometer with noise: no function of the heater, nor of its lag or play, explains that noise.
    #[test]
    fn a_closed_loop_is_no_gap() {
        let gain = Parameter::new("K", "K/V", 0.5, 4.0);
        let tau = Parameter::new("tau", "s", 1.0, 20.0);
        let room = OneState::new([gain, tau], |theta, u, x| (theta[0] * u[0] - x) / theta[1]);
        let mut source = Noise::new(1, "loop", 1).source("all");
        let (mut x, mut inputs, mut outputs) = (0.0, vec![], vec![]);
        for k in 0..300 {
            let read = x + 0.05 * source.normal();
            let u = 3.0 * (f64::from(k / 50 % 2) - read);
            inputs.push(u);
            outputs.push(read);
            x += 0.5 * (2.0 * u - x) / 5.0 + 0.05 * source.normal();
        }
        let column = |values| Signal::from_shape_vec((300, 1), values).unwrap();
        let drive = Drive::new(0.5, column(inputs)).unwrap();
        let record = Record::new(drive, column(outputs)).unwrap();
        let settings = DiagnoseSettings {
            quick: true,
            ..DiagnoseSettings::default()
        };
        let study = Study::of(room).unwrap();
        let found = diagnose(&study, &[record], None, &settings, &Progress::silent()).unwrap();
        let gained = found.detection.log_evidence;
        assert_eq!(found.verdict, Verdict::NoGap, "{gained}");
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
