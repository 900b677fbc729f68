//! Results of a row, and who takes them.

use crate::likelihood::kalman::gaussian::Belief;
use crate::likelihood::kalman::likelihood::LOG_TWO_PI;
use crate::likelihood::kalman::order::Order;

/// Innovation of one row.
pub(in crate::likelihood::kalman) struct Innovation<'w, N = f64> {
    /// Outputs given the rows before.
    pub predicted: &'w [N],
    pub innovation: &'w [N],
    /// p × p.
    pub covariance: &'w [N],
    /// Innovation and variances as they would be of a signal with noise alone, without ends of a range, rounding, outliers.
    pub plain: [&'w [N]; 2],
    /// Not of lanes.
    pub standardised: &'w [N],
    /// The row of the record; NaN where an output is missing, and so has no density.
    pub(super) measured: &'w [N],
    /// Variance of each output given those before it.
    pub(super) pivots: &'w [N],
    /// Nats by which the density exceeds a normal one.
    pub excess: N,
    pub(super) order: &'w Order<'w>,
    pub(super) row: usize,
}

impl<N> Innovation<'_, N> {
    /// Sample at which the record has output j, if it has it.
    pub fn sample_of(&self, j: usize) -> Option<usize> {
        self.order.sample_of(self.row, j)
    }
}

impl Innovation<'_> {
    /// log p(y_k | y_0 … y_{k−1}), in nats.
    pub fn log_density(&self) -> f64 {
        let values = (self.standardised.iter().zip(self.pivots)).zip(self.measured);
        let sum: f64 = values
            .filter(|(_, y)| !y.is_nan())
            .map(|((e, pivot), _)| LOG_TWO_PI + pivot.ln() + e * e)
            .sum();
        self.excess - 0.5 * sum
    }
}

/// Receiver of the results of a pass. Results that it does not need are not computed.
pub(in crate::likelihood::kalman) trait Sink<N = f64> {
    /// Returns `true` if [`carried`](Self::carried) is wanted.
    fn wants_carried(&self) -> bool {
        false
    }
    /// Takes that of row i in the [`Order`] of the filter.
    fn innovation(&mut self, _i: usize, _of: &Innovation<'_, N>) {}
    /// State given rows up to k.
    fn filtered(&mut self, _k: usize, _state: Belief<'_, N>) {}
    /// State of row k + 1 given rows up to k, and cov(x_k, x_{k+1}).
    fn carried(&mut self, _k: usize, _next: Belief<'_, N>, _cross: &[N]) {}
}

impl<N> Sink<N> for () {}
