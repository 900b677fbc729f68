//! Result of a filter over a record.

use super::gaussian::{Belief, Gaussian};
use super::pass::{Innovation, Sink};
use super::{FilterError, Kalman};
use crate::record::Signal;
use ndarray::{Array3, s};

/// A record as the filter saw it; N samples, p outputs, n states. A missing output has innovation 0, variance 1, no covariance
/// with others, and no part in a density.
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
    /// Innovations in their own units, uncorrelated across outputs (N × p): independent N(0, 1) if the twin is
    /// right and linear.
    pub standardised: Signal,
    /// States given the outputs up to their own sample; only where the settings ask for them.
    pub states: Option<States>,
}

impl Filtered {
    pub(super) fn new(samples: usize, p: usize, states: Option<usize>) -> Self {
        Self {
            log_likelihood: 0.0,
            log_densities: vec![0.0; samples],
            innovations: Signal::zeros((samples, p)),
            covariances: Array3::zeros((samples, p, p)),
            standardised: Signal::zeros((samples, p)),
            states: states.map(|n| States::new(samples, n)),
        }
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
    fn innovation(&mut self, k: usize, of: &Innovation<'_>) {
        self.log_densities[k] = of.log_density();
        let p = of.innovation.len();
        for j in 0..p {
            self.innovations[[k, j]] = of.innovation[j];
            self.standardised[[k, j]] = of.standardised[j];
            for i in 0..p {
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
            let state = Gaussian {
                mean: self.means.row(k).to_vec(),
                cov: self
                    .covariances
                    .slice(s![k, .., ..])
                    .iter()
                    .copied()
                    .collect(),
            };
            self.set(k, f(state).as_belief());
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

impl Kalman<'_> {
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
            states.map(|state| self.told(state));
        }
        Ok(filtered)
    }
}
