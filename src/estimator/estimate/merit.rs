//! Merit of an answer: how well the twin predicts and follows the record there.

use super::tracking::Tracking;
use crate::likelihood::likelihood_of;
use crate::record::Record;
use crate::twin::Twin;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// A free run whose error is this much larger is worse: process noise alone moves the error of the truth's own run by as much.
/// Measured on the tanks (30 records, k1 outside its prior): no right answer is refused.
const LARGER: f64 = 1.2;
/// Probability that the likelihood at the truth lies so far below its top.
const BY_CHANCE: f64 = 0.1;

/// Likelihood and free-run error of a record at one θ.
#[derive(Debug, Clone, Copy)]
pub(super) struct Merit {
    /// In nats; none for a black box, or where the filter fails.
    pub log_likelihood: Option<f64>,
    /// Root mean square of record − free run; none where it diverges.
    pub rmse: Option<f64>,
}

impl Merit {
    /// The merit of `twin` at `theta`.
    pub fn of(twin: &Twin, record: &Record, theta: &[f64], run: Option<&Tracking>) -> Self {
        let likelihood = likelihood_of(twin);
        let log_likelihood = match likelihood.is_simulated() {
            true => None,
            false => (likelihood.log_likelihood(theta, record).ok()).map(|(value, _)| value),
        };
        Self {
            log_likelihood: log_likelihood.filter(|value| value.is_finite()),
            rmse: run.map(|run| run.rmse),
        }
    }

    /// Returns whether an answer explains the record worse than `first` does, for all that chance and `parameters` fitted parameters
    /// explain.
    pub fn is_worse_than(&self, first: &Self, parameters: usize) -> bool {
        let chance = ChiSquared::new(parameters as f64)
            .map_or(0.0, |chi| 0.5 * chi.inverse_cdf(1.0 - BY_CHANCE));
        let less_likely = match (self.log_likelihood, first.log_likelihood) {
            (Some(own), Some(first)) => own + chance < first,
            (None, Some(_)) => first.rmse.is_some(),
            _ => false,
        };
        let farther = match (self.rmse, first.rmse) {
            (Some(own), Some(first)) => own > LARGER * first,
            (None, Some(_)) => true,
            _ => false,
        };
        less_likely || farther
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn worse_is_less_likely_or_farther_beyond_chance() {
        let merit = |log_likelihood, rmse| Merit {
            log_likelihood,
            rmse,
        };
        let first = merit(Some(100.0), Some(1.0));
        for (own, worse) in [
            (merit(Some(97.0), Some(1.1)), false),
            (merit(Some(95.0), Some(0.9)), true),
            (merit(Some(120.0), Some(1.3)), true),
            (merit(Some(120.0), None), true),
            (merit(None, Some(0.5)), true),
        ] {
            assert_eq!(own.is_worse_than(&first, 4), worse, "{own:?}");
        }
        let diverged = merit(None, None);
        assert!(!merit(None, Some(9.0)).is_worse_than(&diverged, 4));
        assert!(!diverged.is_worse_than(&diverged, 4));
    }
}
