//! Result of a filter over a record.

use super::gaussian::{Belief, Gaussian};
use super::likelihood::LOG_TWO_PI;
use super::order::Order;
use super::pass::{AnyPass, Innovation, Pass, Sink};
use super::size::Any;
use super::{FilterError, Kalman};
use crate::record::Signal;
use ndarray::{Array3, s};

/// A record as the filter saw it; N samples, p outputs, n states. A missing output has innovation 0, variance 1, no covariance
/// with others, and no part in a density. An output with a dead time is predicted beside the state that it shows: from its own past, and from
/// that of other outputs before that state.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Filtered {
    /// log p(y | θ), in nats.
    pub log_likelihood: f64,
    /// log p(y_k | y_0 … y_{k−1}, θ), in nats (N); they add up to the log-likelihood.
    pub log_densities: Vec<f64>,
    /// y_k less its prediction from the past, in output units (N × p).
    pub innovations: Signal,
    /// Covariance of each innovation (N × p × p).
    pub covariances: Array3<f64>,
    /// Innovations in their own units, uncorrelated across outputs (N × p): independent N(0, 1) if the twin is right and linear.
    pub standardised: Signal,
    /// States given the outputs up to their own sample; only where the settings ask for them.
    pub states: Option<States>,
}

impl Filtered {
    pub(in crate::likelihood) fn new(samples: usize, p: usize, states: Option<usize>) -> Self {
        Self {
            log_likelihood: 0.0,
            log_densities: vec![0.0; samples],
            innovations: Signal::zeros((samples, p)),
            covariances: Array3::zeros((samples, p, p)),
            standardised: Signal::zeros((samples, p)),
            states: states.map(|n| States::new(samples, n)),
        }
    }

    /// Creates that of one output from the innovation, its variance and the excess of the log-density row by row.
    pub(super) fn of_one_output(
        log_likelihood: f64,
        rows: impl Iterator<Item = [f64; 3]>,
        outputs: &Signal,
    ) -> Self {
        let mut filtered = Self::new(outputs.nrows(), 1, None);
        filtered.log_likelihood = log_likelihood;
        for (k, [innovation, variance, excess]) in rows.enumerate() {
            let standardised = innovation / variance.sqrt();
            filtered.innovations[[k, 0]] = innovation;
            filtered.covariances[[k, 0, 0]] = variance;
            filtered.standardised[[k, 0]] = standardised;
            if !outputs[[k, 0]].is_nan() {
                let square = standardised * standardised;
                filtered.log_densities[k] = excess - 0.5 * (LOG_TWO_PI + variance.ln() + square);
            }
        }
        filtered
    }

    /// Variance of each innovation (N × p).
    pub fn variances(&self) -> Signal {
        let (samples, p, _) = self.covariances.dim();
        Signal::from_shape_fn((samples, p), |(k, j)| self.covariances[[k, j, j]])
    }

    /// Prediction of each output from the past, given the outputs themselves (N × p); NaN where one is missing.
    pub fn predictions(&self, outputs: &Signal) -> Signal {
        outputs - &self.innovations
    }

    /// As [`predictions`](Self::predictions), each missing one replaced by the one before it, or else by the next.
    pub(crate) fn held_predictions(&self, outputs: &Signal) -> Signal {
        let mut predictions = self.predictions(outputs);
        for mut column in predictions.columns_mut() {
            let mut last = column.iter().copied().find(|v| !v.is_nan()).unwrap_or(0.0);
            for value in &mut column {
                match value.is_nan() {
                    true => *value = last,
                    false => last = *value,
                }
            }
        }
        predictions
    }
}

impl Sink for Filtered {
    fn innovation(&mut self, _: usize, of: &Innovation<'_>) {
        let (p, samples) = (of.innovation.len(), self.innovations.nrows());
        let there = |j: usize| of.sample_of(j).filter(|k| *k < samples);
        if let Some(k) = (0..p).find_map(there) {
            self.log_densities[k] += of.log_density();
        }
        for j in 0..p {
            let Some(k) = there(j) else {
                continue;
            };
            self.innovations[[k, j]] = of.innovation[j];
            self.standardised[[k, j]] = of.standardised[j];
            for i in (0..p).filter(|&i| there(i) == Some(k)) {
                self.covariances[[k, i, j]] = of.covariance[i * p + j];
            }
        }
    }

    fn filtered(&mut self, k: usize, state: Belief<'_>) {
        if let Some(states) = &mut self.states {
            states.set(k, state);
        }
    }
}

/// Means and covariances of the states at each sample; N samples, n states in the order of the twin's outline.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct States {
    /// Means (N × n), in state units.
    pub means: Signal,
    /// Covariances (N × n × n).
    pub covariances: Array3<f64>,
}

impl States {
    pub(super) fn new(samples: usize, n: usize) -> Self {
        Self {
            means: Signal::zeros((samples, n)),
            covariances: Array3::zeros((samples, n, n)),
        }
    }

    /// Standard deviations (N × n), in state units.
    pub fn standard_deviations(&self) -> Signal {
        Signal::from_shape_fn(self.means.dim(), |(k, i)| {
            self.covariances[[k, i, i]].max(0.0).sqrt()
        })
    }

    pub(super) fn map(&mut self, f: impl Fn(Gaussian) -> Gaussian) {
        for k in 0..self.means.nrows() {
            self.set(k, f(self.row(k)).as_belief());
        }
    }

    pub(super) fn row(&self, k: usize) -> Gaussian {
        let covariance = self.covariances.slice(s![k, .., ..]);
        Gaussian {
            mean: self.means.row(k).to_vec(),
            cov: covariance.iter().copied().collect(),
        }
    }

    pub(super) fn set(&mut self, k: usize, state: Belief<'_>) {
        for (to, from) in self.means.row_mut(k).iter_mut().zip(state.mean) {
            *to = *from;
        }
        let mut covariance = self.covariances.slice_mut(s![k, .., ..]);
        for (to, from) in covariance.iter_mut().zip(state.cov) {
            *to = *from;
        }
    }
}

/// Outputs predicted from the rows before.
struct Predictions {
    values: Signal,
    /// First sample that is written.
    first: usize,
    /// Outputs that are left as they are.
    skipped: Vec<bool>,
    /// States given the rows so far, where they are wanted.
    states: Option<Vec<Gaussian>>,
}

impl Sink for Predictions {
    fn innovation(&mut self, _: usize, of: &Innovation<'_>) {
        for j in (0..self.skipped.len()).filter(|&j| !self.skipped[j]) {
            let k = of.sample_of(j).filter(|k| *k >= self.first);
            if let Some(to) = k.and_then(|k| self.values.get_mut([k, j])) {
                *to = of.predicted[j];
            }
        }
    }

    fn filtered(&mut self, _: usize, state: Belief<'_>) {
        if let Some(states) = &mut self.states {
            states.push(Gaussian::of(state));
        }
    }
}

/// Means of the states at each `stride`-th sample, one list a state.
struct Means<'k> {
    kalman: &'k Kalman<'k>,
    stride: usize,
    all: Vec<Vec<f64>>,
}

impl Sink for Means<'_> {
    fn filtered(&mut self, k: usize, state: Belief<'_>) {
        if k.is_multiple_of(self.stride) {
            let held = self.kalman.held_in_limits(Gaussian::of(state));
            for (all, mean) in self.all.iter_mut().zip(held.mean) {
                all.push(mean);
            }
        }
    }
}

impl Kalman<'_> {
    /// Means of the states given the rows so far, at each `stride`-th sample, one list a state.
    ///
    /// # Errors
    ///
    /// As [`log_likelihood`](Self::log_likelihood).
    pub(crate) fn filtered_means(
        &self,
        theta: &[f64],
        stride: usize,
    ) -> Result<Vec<Vec<f64>>, FilterError> {
        let mut means = Means {
            kalman: self,
            stride,
            all: vec![vec![]; self.states],
        };
        self.run(theta, &mut means)?;
        Ok(means.all)
    }

    /// Everything that [`Filtered`] holds.
    ///
    /// # Errors
    ///
    /// As [`log_likelihood`](Self::log_likelihood).
    pub fn filter(&self, theta: &[f64]) -> Result<Filtered, FilterError> {
        let states = self.settings.keep_states.then_some(self.states);
        let mut filtered = Filtered::new(self.record.samples(), self.channels, states);
        filtered.log_likelihood = self.run(theta, &mut filtered)?;
        if let Some(states) = &mut filtered.states {
            states.map(|state| self.held_in_limits(state));
        }
        Ok(filtered)
    }

    /// Each output as predicted from the rows before it, N × p. Over rows that are missing, the prediction reaches as far ahead as they
    /// last. Beside an output with a dead time, the last rows before are left out, as many as two dead times at most.
    ///
    /// # Errors
    ///
    /// As [`log_likelihood`](Kalman::log_likelihood).
    pub(crate) fn predictions(&self, theta: &[f64]) -> Result<Signal, FilterError> {
        let order = Order::of(self, theta)?;
        let mut all = Predictions {
            values: Signal::zeros(self.record.outputs().dim()),
            first: 0,
            skipped: vec![false; self.channels],
            states: (!order.is_plain()).then(Vec::new),
        };
        self.run_in(&order, theta, &mut all as &mut dyn Sink)?;
        if let Some(states) = all.states.take() {
            self.predict_punctual(&order, theta, &states, &mut all)?;
        }
        Ok(all.values)
    }

    /// Predicts the outputs without dead time anew: in the filter's order, those with one are ahead of them. Each block of rows begins
    /// with what had been shown by its first.
    fn predict_punctual(
        &self,
        order: &Order<'_>,
        theta: &[f64],
        states: &[Gaussian],
        to: &mut Predictions,
    ) -> Result<(), FilterError> {
        to.skipped = (0..self.channels).map(|j| order.is_late(j)).collect();
        let punctual = order.punctual(self);
        let jobs = &[self.job(&punctual, theta)?];
        let size = Any {
            states: self.states,
            outputs: self.channels,
        };
        let (samples, block) = (self.record.samples(), order.ahead());
        for first in (0..samples).step_by(block) {
            let shown = first.checked_sub(block + 1);
            to.first = first;
            let mut pass = match shown {
                Some(k) => Pass::behind(size, jobs, (k, states[k].as_belief()), to),
                None => Pass::new(size, jobs),
            };
            AnyPass::run_to(&mut pass, (first + block).min(samples), to)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::likelihood::kalman::FilterSettings;
    use crate::record::{Drive, Record};
    use crate::twin::{DigitalTwin, Noise};
    use crate::twins::CascadedTanks;

    #[test]
    fn predictions_are_outputs_less_innovations_and_reach_over_gaps() {
        let drive = Drive::new(0.5, Signal::from_elem((200, 1), 1.5)).unwrap();
        let theta = [0.6, 0.5, 0.55, 1.0];
        let noise = Noise::new(1, "ahead", 0);
        let outputs = CascadedTanks.simulate(&theta, &drive, noise).unwrap();
        let settings = FilterSettings::default();
        let predicted = |outputs: &Signal| {
            let record = Record::new(drive.clone(), outputs.clone()).unwrap();
            let kalman = Kalman::new(CascadedTanks, &record, &settings).unwrap();
            (
                kalman.predictions(&theta).unwrap(),
                kalman.filter(&theta).unwrap(),
            )
        };
        let (all, filtered) = predicted(&outputs);
        assert!(
            (&(&all + &filtered.innovations) - &outputs)
                .iter()
                .all(|d| d.abs() < 1e-12)
        );
        let mut gappy = outputs.clone();
        gappy.slice_mut(ndarray::s![100..120, ..]).fill(f64::NAN);
        let (ahead, _) = predicted(&gappy);
        assert!(ahead.iter().all(|v| v.is_finite()));
        assert_eq!(
            ahead[[100, 0]],
            all[[100, 0]],
            "row 100 is one step ahead in both"
        );
        assert_ne!(ahead[[119, 0]], all[[119, 0]]);
    }
}
