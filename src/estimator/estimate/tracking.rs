//! The calibrated twin beside the record: its free run, and a comparison of two answers by run and likelihood.

use crate::estimator::budget::BUDGET;
use crate::fit::least_squares::{Bounds, GaussNewton, ResidualProblem};
use crate::likelihood::likelihood_of;
use crate::math::{MathError, Stencil};
use crate::record::{Record, Signal};
use crate::twin::{DigitalTwin, Noise, Role, Twin};
use nalgebra::{DMatrix, DVector};
use ndarray::Array1;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// A free run beside a record.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Tracking {
    /// Outputs of the free run, N × channels.
    pub outputs: Signal,
    /// Root mean square of record − free run over all outputs that are not missing, in output units.
    pub rmse: f64,
    /// θ with unknown starts refitted to this record.
    pub theta: Vec<f64>,
}

/// The free run at θ, unknown starts refitted to the record by least squares; other parameters stay.
pub(super) fn track(
    twin: &dyn DigitalTwin,
    theta: &[f64],
    record: &Record,
) -> Result<Tracking, MathError> {
    let space = twin.parameters();
    let starts: Vec<usize> = (0..space.len())
        .filter(|&j| space[j].role == Role::Start)
        .collect();
    let of = |value: &dyn Fn(usize) -> f64| {
        DVector::from_iterator(starts.len(), starts.iter().map(|&j| value(j)))
    };
    let begin = of(&|j| theta[j]);
    let problem = StartFit {
        twin,
        theta,
        record,
        widths: of(&|j| space[j].prior.width()),
        bounds: Bounds::new(
            of(&|j| space[j].bounds.low()),
            of(&|j| space[j].bounds.high()),
        )?,
        starts,
    };
    let mut fitted = theta.to_vec();
    if !problem.starts.is_empty() {
        let StartFit { bounds, widths, .. } = &problem;
        let minimum = GaussNewton::default().minimise(&problem, &begin, bounds, widths)?;
        fitted = problem.with(&minimum.theta);
    }
    let outputs = twin
        .free_run(&fitted, record.drive())
        .map_err(|error| MathError::Start(error.into()))?;
    let errors = record.outputs() - &outputs;
    let errors = errors.iter().filter(|d| !d.is_nan());
    let squares: Array1<f64> = errors.map(|d| d * d).collect();
    Ok(Tracking {
        rmse: squares.mean().unwrap_or(0.0).sqrt(),
        outputs,
        theta: fitted,
    })
}

/// Residuals of the free run as a function of the unknown starts.
struct StartFit<'a> {
    twin: &'a dyn DigitalTwin,
    theta: &'a [f64],
    record: &'a Record,
    /// Their places in θ.
    starts: Vec<usize>,
    /// Their bounds, and the widths of their priors.
    bounds: Bounds,
    widths: DVector<f64>,
}

impl StartFit<'_> {
    /// θ with these starts.
    fn with(&self, starts: &DVector<f64>) -> Vec<f64> {
        let mut theta = self.theta.to_vec();
        for (&j, value) in self.starts.iter().zip(starts.iter()) {
            theta[j] = *value;
        }
        theta
    }
}

impl ResidualProblem for StartFit<'_> {
    fn dimension(&self) -> usize {
        self.starts.len()
    }

    fn residual(&self, starts: &DVector<f64>) -> Result<DVector<f64>, MathError> {
        let run = self.twin.free_run(&self.with(starts), self.record.drive());
        let run = run.map_err(MathError::rejected)?;
        let rows = (self.record.outputs().iter().zip(&run))
            .filter(|(y, _)| !y.is_nan())
            .map(|(y, f)| f - y);
        Ok(DVector::from_vec(rows.collect()))
    }

    fn jacobian(&self, starts: &DVector<f64>) -> Result<DMatrix<f64>, MathError> {
        let steps = 1e-4 * &self.widths;
        let [low, high] = [self.bounds.lower(), self.bounds.upper()].map(DVector::as_slice);
        let stencil = Stencil::new(starts.as_slice(), steps.as_slice(), low, high)
            .map_err(MathError::fatal)?;
        stencil.jacobian(|point| self.residual(&DVector::from_column_slice(point)))
    }
}

/// Returns whether an answer explains the record worse than the `first` estimate does, each given with its free run.
pub(super) fn explains_worse(
    twin: &Twin,
    record: &Record,
    answer: (&[f64], Option<&Tracking>),
    first: (&[f64], Option<&Tracking>),
    noise: Noise,
) -> bool {
    let agreement = |(theta, run)| Agreement::of(twin, record, theta, run);
    let by_chance = || error_by_chance(twin, answer.0, record, noise);
    agreement(answer).is_worse_than(&agreement(first), first.0.len(), by_chance)
}

/// Likelihood and free-run error of a record at one θ.
#[derive(Debug, Clone, Copy)]
struct Agreement {
    /// In nats; none for a black box, or where the filter fails.
    log_likelihood: Option<f64>,
    /// Root mean square of record − free run; none where it diverges.
    rmse: Option<f64>,
}

impl Agreement {
    /// Computes both of `twin` at `theta`.
    fn of(twin: &Twin, record: &Record, theta: &[f64], run: Option<&Tracking>) -> Self {
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
    fn is_worse_than(
        &self,
        first: &Self,
        parameters: usize,
        by_chance: impl FnOnce() -> Option<f64>,
    ) -> bool {
        let chance = ChiSquared::new(parameters as f64)
            .map_or(0.0, |chi| 0.5 * chi.inverse_cdf(1.0 - BUDGET.less_likely));
        let less_likely = match (self.log_likelihood, first.log_likelihood) {
            (Some(own), Some(first)) => own + chance < first,
            (None, Some(_)) => first.rmse.is_some(),
            _ => false,
        };
        less_likely
            || match (self.rmse, first.rmse) {
                (Some(own), Some(first)) => {
                    own > BUDGET.larger_error * first
                        && by_chance().is_none_or(|chance| own > chance)
                }
                (None, Some(_)) => true,
                _ => false,
            }
    }
}

/// Largest free-run error of the records that `twin` makes at `theta` under the record's input; `None` where one fails.
fn error_by_chance(twin: &Twin, theta: &[f64], record: &Record, noise: Noise) -> Option<f64> {
    let drive = record.drive();
    let errors = (0..BUDGET.own_records).map(|i| {
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
        let agreement = |log_likelihood, rmse| Agreement {
            log_likelihood,
            rmse,
        };
        let first = agreement(Some(100.0), Some(1.0));
        for (own, worse) in [
            (agreement(Some(97.0), Some(1.1)), false),
            (agreement(Some(95.0), Some(0.9)), true),
            (agreement(Some(120.0), Some(1.3)), true),
            (agreement(Some(120.0), None), true),
            (agreement(None, Some(0.5)), true),
        ] {
            assert_eq!(own.is_worse_than(&first, 4, || Some(1.2)), worse, "{own:?}");
        }
        // Farther, but no farther than records of the twin itself.
        assert!(!agreement(Some(120.0), Some(1.3)).is_worse_than(&first, 4, || Some(1.4)));
        assert!(agreement(Some(120.0), Some(1.3)).is_worse_than(&first, 4, || None));
        let diverged = agreement(None, None);
        assert!(!agreement(None, Some(9.0)).is_worse_than(&diverged, 4, || None));
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
