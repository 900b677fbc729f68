//! Merit of an answer: how well the twin predicts and follows the record there.

use super::tracking::{Tracking, track};
use crate::likelihood::likelihood_of;
use crate::record::Record;
use crate::twin::{Noise, Twin};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Ratio of free-run errors from which on the twin's own records are asked: few answers pay for them.
const LARGER: f64 = 1.2;
/// Records of the twin itself that a free run's error is compared with: by chance, one in twenty lies beyond all.
const OWN_RECORDS: u64 = 19;
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
    /// explain. `by_chance` is the error that a free run at the answer has by chance: under process noise the truth's own run departs
    /// from the record, and one of another θ may happen to stay nearer.
    pub fn is_worse_than(
        &self,
        first: &Self,
        parameters: usize,
        by_chance: impl FnOnce() -> Option<f64>,
    ) -> bool {
        let chance = ChiSquared::new(parameters as f64)
            .map_or(0.0, |chi| 0.5 * chi.inverse_cdf(1.0 - BY_CHANCE));
        let less_likely = match (self.log_likelihood, first.log_likelihood) {
            (Some(own), Some(first)) => own + chance < first,
            (None, Some(_)) => first.rmse.is_some(),
            _ => false,
        };
        less_likely
            || match (self.rmse, first.rmse) {
                (Some(own), Some(first)) => {
                    own > LARGER * first && by_chance().is_none_or(|chance| own > chance)
                }
                (None, Some(_)) => true,
                _ => false,
            }
    }
}

/// Largest free-run error of [`OWN_RECORDS`] records that `twin` makes at `theta` under the record's input; `None` where one fails.
pub(super) fn error_by_chance(
    twin: &Twin,
    theta: &[f64],
    record: &Record,
    noise: Noise,
) -> Option<f64> {
    let drive = record.drive();
    let errors = (0..OWN_RECORDS).map(|i| {
        let outputs = twin.simulate(theta, drive, noise.sample(i)).ok()?;
        let own = Record::new(drive.clone(), outputs).ok()?;
        Some(track(twin, theta, &own).ok()?.rmse)
    });
    errors.reduce(|a, b| Some(a?.max(b?)))?
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::{RecordPlan, Study};
    use crate::twins::CascadedTanks;

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
            assert_eq!(own.is_worse_than(&first, 4, || Some(1.2)), worse, "{own:?}");
        }
        // Farther, but no farther than records of the twin itself.
        assert!(!merit(Some(120.0), Some(1.3)).is_worse_than(&first, 4, || Some(1.4)));
        assert!(merit(Some(120.0), Some(1.3)).is_worse_than(&first, 4, || None));
        let diverged = merit(None, None);
        assert!(!merit(None, Some(9.0)).is_worse_than(&diverged, 4, || None));
        assert!(!diverged.is_worse_than(&diverged, 4, || None));
    }

    /// One in twenty records of the twin lies beyond the error by chance; of sixty, more than eight have a chance of 1 in 300.
    #[test]
    fn the_error_by_chance_is_rarely_exceeded() {
        let plan = RecordPlan::levels(0.5, 200, 0.0, 3.0, 30);
        let study = Study::new("tanks", CascadedTanks, plan).unwrap();
        let twin = study.twin();
        let theta = twin.parameters().centre();
        let beyond = |seed: u64| {
            let drive = study.drive(Noise::new(seed, "drive", 0)).unwrap();
            let outputs = twin.simulate(&theta, &drive, Noise::new(seed, "record", 0));
            let record = Record::new(drive, outputs.unwrap()).unwrap();
            let chance = error_by_chance(twin, &theta, &record, Noise::new(seed, "own", 0));
            track(twin, &theta, &record).unwrap().rmse > chance.unwrap()
        };
        let count = (0..60).filter(|&seed| beyond(seed)).count();
        assert!((1..=8).contains(&count), "{count} of 60");
    }
}
