//! States given the whole record: of all rows by a backward pass, of the first one on the way forward.

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

/// The first state given the rows so far.
struct FirstState {
    state: Gaussian,
    /// G_0⋯G_{k−1}: what a change of row k does to the first one.
    gain: Vec<f64>,
    /// Row k before its outputs are known.
    predicted: Gaussian,
    root: Root,
    /// G_k, the change of a covariance, and two products.
    own: Vec<f64>,
    change: Vec<f64>,
    product: Vec<f64>,
}

impl FirstState {
    fn new(n: usize) -> Self {
        let square = vec![0.0; n * n];
        let mut gain = square.clone();
        gain.iter_mut().step_by(n + 1).for_each(|g| *g = 1.0);
        Self {
            // Nothing is known before the first row: its whole state is the change.
            state: Gaussian::zero(n),
            gain,
            predicted: Gaussian::zero(n),
            root: Root::new(n),
            own: square.clone(),
            change: square.clone(),
            product: square,
        }
    }
}

impl Sink for FirstState {
    fn wants_carried(&self) -> bool {
        true
    }
    fn filtered(&mut self, _: usize, now: Belief<'_>) {
        let n = now.mean.len();
        for (to, row) in self.state.mean.iter_mut().zip(self.gain.chunks_exact(n)) {
            let moved = row.iter().zip(now.mean).zip(&self.predicted.mean);
            *to += moved
                .map(|((g, now), before)| g * (now - before))
                .sum::<f64>();
        }
        let moved = now.cov.iter().zip(&self.predicted.cov);
        (self.change.iter_mut().zip(moved)).for_each(|(to, (now, before))| *to = now - before);
        product(&self.gain, &self.change, n, &mut self.product);
        add_symmetric(&self.product, &self.gain, n, &mut self.state.cov);
    }
    fn carried(&mut self, _: usize, next: Belief<'_>, cross: &[f64]) {
        let n = next.mean.len();
        self.root.factor(next.mean, next.cov);
        self.own.copy_from_slice(cross);
        for row in self.own.chunks_exact_mut(n) {
            self.root.solve(row);
        }
        product(&self.gain, &self.own, n, &mut self.product);
        std::mem::swap(&mut self.gain, &mut self.product);
        self.predicted.mean.copy_from_slice(next.mean);
        self.predicted.cov.copy_from_slice(next.cov);
    }
}

impl Kalman<'_> {
    /// The state at the first sample given the whole record, as [`smooth`](Self::smooth) finds it, in the memory of one row:
    ///
    /// ```text
    /// B_0 = 1,   B_{k+1} = B_k·G_k
    /// m_0 ← m_0 + B_k·(m_k − m⁻_k),   P_0 ← P_0 + B_k·(P_k − P⁻_k)·B_kᵀ
    /// ```
    ///
    /// Source: Meditch, *Stochastic Optimal Linear Estimation and Control* (1969), chapter 6.
    ///
    /// # Errors
    ///
    /// As [`log_likelihood`](Self::log_likelihood).
    pub(crate) fn first_state(&self, theta: &[f64]) -> Result<Gaussian, FilterError> {
        let mut first = FirstState::new(self.states);
        self.run(theta, &mut first)?;
        Ok(self.held_in_limits(first.state))
    }

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

    /// Process noise of each step given the whole record, in state units (N × n), beside the states; zero in the first row, as it moves a state
    /// to the row it stands in:
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
    pub(crate) fn disturbances(&self, theta: &[f64]) -> Result<(Signal, States), FilterError> {
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
        Ok((pulls, states))
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
                add_symmetric(&left, gain, n, &mut state.cov);
            }
            states.set(k, self.held_in_limits(state.clone()).as_belief());
            later = state;
        }
        Ok((states, pulls))
    }
}

/// Adds a·bᵀ, which is symmetric, n × n, row-major.
fn add_symmetric(a: &[f64], b: &[f64], n: usize, to: &mut [f64]) {
    for i in 0..n {
        for j in 0..=i {
            to[i * n + j] += (0..n).map(|c| a[i * n + c] * b[j * n + c]).sum::<f64>();
            to[j * n + i] = to[i * n + j];
        }
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
