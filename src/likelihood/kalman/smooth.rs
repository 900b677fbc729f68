//! States given the whole record.

use super::gaussian::{Belief, Gaussian, Root};
use super::pass::Sink;
use super::{FilterError, Kalman, States};
use crate::record::Signal;

/// Rows as the backward pass needs them.
struct Tape {
    filtered: States,
    /// Mean and covariance of the next row, and the covariance with it, row by row.
    carried: Vec<f64>,
}

impl Sink for Tape {
    fn wants_carried(&self) -> bool {
        true
    }
    fn filtered(&mut self, k: usize, state: Belief<'_>) {
        self.filtered.set(k, state);
    }
    fn carried(&mut self, _: usize, next: Belief<'_>, cross: &[f64]) {
        for part in [next.mean, next.cov, cross] {
            self.carried.extend_from_slice(part);
        }
    }
}

impl Kalman<'_> {
    /// States at each sample given the whole record, by the backward pass of Rauch, Tung & Striebel:
    ///
    /// ```text
    /// G_k = cov(x_k, x_{k+1}) · P⁻_{k+1}⁻¹
    /// m_k ← m_k + G_k·(m_{k+1} − m⁻_{k+1}),   P_k ← P_k + G_k·(P_{k+1} − P⁻_{k+1})·G_kᵀ
    /// ```
    ///
    /// The cross-covariances come from the filter's own points. Limited states are held in their limits at the end.
    ///
    /// Source: Särkkä, *Bayesian Filtering and Smoothing* (2013), chapter 9.
    ///
    /// # Errors
    ///
    /// As [`log_likelihood`](Self::log_likelihood).
    pub fn smooth(&self, theta: &[f64]) -> Result<States, FilterError> {
        Ok(self.backwards(theta)?.0)
    }

    /// Process noise of each step given the whole record, in state units (N × n); zero in the first row, as it moves a state to the row it
    /// stands in:
    ///
    /// ```text
    /// w_k = Q_k·P⁻_{k+1}⁻¹·(m_{k+1} − m⁻_{k+1})
    /// ```
    ///
    /// Source: Koopman, "Disturbance smoother for state space models", *Biometrika* 80 (1993).
    ///
    /// # Errors
    ///
    /// As [`log_likelihood`](Self::log_likelihood).
    pub(crate) fn disturbances(&self, theta: &[f64]) -> Result<Signal, FilterError> {
        let (states, mut pulls) = self.backwards(theta)?;
        let acting = self.acting(theta)?;
        let (mut process, mut measurement) = (vec![0.0; self.states], vec![0.0; self.channels]);
        for k in 1..states.means.nrows() {
            process.fill(0.0);
            measurement.fill(0.0);
            let x = states.means.row(k - 1).to_vec();
            self.twin
                .noise(&acting.at(k - 1), &x, &mut process, &mut measurement);
            for (pull, level) in pulls.row_mut(k).iter_mut().zip(&process) {
                *pull *= level * level;
            }
        }
        Ok(pulls)
    }

    /// Smoothed states, and P⁻⁻¹·(m − m⁻) of each row: how strongly the rows from it on pull its prediction (N × n).
    fn backwards(&self, theta: &[f64]) -> Result<(States, Signal), FilterError> {
        let samples = self.record.samples();
        let n = self.states;
        let (both, width) = (n + n * n, n + 2 * n * n);
        let mut tape = Tape {
            filtered: States::new(samples, n),
            carried: Vec::with_capacity(samples.saturating_sub(1) * width),
        };
        self.run(theta, &mut tape)?;
        // Each row is smoothed in its place.
        let (mut states, mut carried) = (tape.filtered, tape.carried);
        let mut pulls = Signal::zeros((samples, n));
        let mut root = <Root>::new(n);
        let mut later = Gaussian::zero(n);
        let mut change = vec![0.0; n * n];
        let mut left = vec![0.0; n * n];
        for k in (0..samples).rev() {
            let mut state = states.row(k);
            if let Some(row) = carried.get_mut(k * width..(k + 1) * width) {
                let (next, gain) = row.split_at_mut(both);
                let (next_mean, next_cov) = next.split_at(n);
                root.factor(next_mean, next_cov);
                for row in gain.chunks_exact_mut(n) {
                    root.solve(row);
                }
                let mut pull: Vec<f64> = (later.mean.iter().zip(next_mean))
                    .map(|(later, next)| later - next)
                    .collect();
                root.solve(&mut pull);
                pulls
                    .row_mut(k + 1)
                    .iter_mut()
                    .zip(pull)
                    .for_each(|(to, v)| *to = v);
                for (i, row) in gain.chunks_exact(n).enumerate() {
                    for (j, g) in row.iter().enumerate() {
                        state.mean[i] += g * (later.mean[j] - next_mean[j]);
                    }
                }
                for ((to, a), b) in change.iter_mut().zip(&later.cov).zip(next_cov) {
                    *to = a - b;
                }
                product(gain, &change, n, &mut left);
                for i in 0..n {
                    for j in 0..=i {
                        let sum: f64 = (0..n).map(|c| left[i * n + c] * gain[j * n + c]).sum();
                        state.cov[i * n + j] += sum;
                        state.cov[j * n + i] = state.cov[i * n + j];
                    }
                }
            }
            states.set(k, self.held_in_limits(state.clone()).as_belief());
            later = state;
        }
        Ok((states, pulls))
    }
}

/// a·b, n × n, row-major.
fn product(a: &[f64], b: &[f64], n: usize, to: &mut [f64]) {
    for i in 0..n {
        for j in 0..n {
            to[i * n + j] = (0..n).map(|c| a[i * n + c] * b[c * n + j]).sum();
        }
    }
}
