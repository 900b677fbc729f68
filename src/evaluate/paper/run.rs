//! Every method on one simulated record.

use super::ScoredMethod;
use super::scenario::SimulatedRecord;
use crate::estimator::{Contributions, Estimate, EstimateOptions, Estimator};
use crate::evaluate::EvaluateError;
use crate::evaluate::baseline::{Initialisation, dual_filter, prediction_error};
use crate::progress::Progress;
use crate::twin::Twin;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Answers of all methods on one record; scores and figures are made of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct BenchmarkRun {
    /// Number, from 0.
    pub run: usize,
    /// True θ.
    pub truth: Vec<f64>,
    /// The refitted estimate's 90 % interval, by parameter; `None` where it has no finite ends, empty where the estimate failed.
    pub interval: Vec<Option<[f64; 2]>>,
    /// In the order of [`ScoredMethod::all`].
    pub answers: Vec<MethodAnswer>,
    /// Contributions of layer and heads to TS-fine.
    #[serde(default)]
    pub(crate) contributions: Option<Contributions>,
    /// Why the estimator gave no estimate, where it did not.
    pub failure: Option<String>,
}

/// Answer of one method.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct MethodAnswer {
    /// Method.
    pub method: ScoredMethod,
    /// θ; `None` where the method cannot be used on this twin, or failed.
    pub theta: Option<Vec<f64>>,
    /// Wall-clock time in milliseconds.
    pub ms: f64,
}

impl BenchmarkRun {
    /// Runs every method. A method that fails leaves no answer: its row says that it cannot be relied on.
    pub(super) fn new(
        estimator: &Estimator,
        run: usize,
        simulated: &SimulatedRecord,
        progress: &Progress,
    ) -> Result<Self, EvaluateError> {
        let twin = estimator.study().twin();
        let SimulatedRecord {
            truth,
            record,
            noise,
        } = simulated;
        let options = EstimateOptions {
            seed: noise.seed().unwrap_or_default(),
            always_refine: true,
            ..EstimateOptions::default()
        };
        let estimate = estimator.estimate_with(record, &options, &progress.unshown());
        // Whatever a stop looks like from inside, it is no failure of the estimator.
        progress.checkpoint()?;
        let (estimate, failure) = match estimate {
            Ok(estimate) => (Some(estimate), None),
            Err(error) => (None, Some(error.to_string())),
        };
        let start = |from: Initialisation| {
            let initial = match (&estimate, from) {
                (Some(estimate), _) => estimate.initial.theta.as_slice(),
                (None, Initialisation::Ts) => return None,
                (None, _) => &[],
            };
            let noise = noise.child("start");
            (from.theta(&twin.parameters(), truth, initial, noise)).ok()
        };
        let answer = |method: ScoredMethod| {
            let clock = Instant::now();
            let (theta, seconds) = match method {
                ScoredMethod::PredictionError(from) => {
                    let fit = |start: Vec<f64>| prediction_error(twin, record, &start).ok();
                    (start(from).and_then(fit), None)
                }
                ScoredMethod::DualFilter(from) => {
                    let theta = match twin {
                        Twin::Equations(equations) => start(from)
                            .and_then(|start| dual_filter(equations, record, &start).ok()),
                        Twin::BlackBox(_) => None,
                    };
                    (theta, None)
                }
                stage => match &estimate {
                    Some(estimate) => of_stage(stage, estimate),
                    None => (None, None),
                },
            };
            let seconds = seconds.unwrap_or_else(|| clock.elapsed().as_secs_f64());
            MethodAnswer {
                method,
                theta: theta.filter(|theta| theta.iter().all(|v| v.is_finite())),
                ms: 1000.0 * seconds,
            }
        };
        let interval = |estimate: &Estimate| {
            let ends = estimate.low.iter().zip(&estimate.high);
            ends.map(|(&low, &high)| {
                Some([low, high]).filter(|ends| ends.iter().all(|v| v.is_finite()))
            })
            .collect()
        };
        Ok(Self {
            run,
            truth: truth.clone(),
            interval: estimate.as_ref().map(interval).unwrap_or_default(),
            answers: ScoredMethod::all().into_iter().map(answer).collect(),
            contributions: estimate.and_then(|estimate| {
                estimate
                    .refit()
                    .and_then(|refit| refit.contributions.clone())
            }),
            failure,
        })
    }

    /// Returns true if this may be a run of a study with `parameters` parameters.
    pub(super) fn fits(&self, parameters: usize) -> bool {
        let whole = |theta: &Vec<f64>| theta.len() == parameters;
        let methods = self.answers.iter().map(|answer| answer.method);
        whole(&self.truth)
            && (self.interval.len() == parameters
                || (self.interval.is_empty() && self.failure.is_some()))
            && methods.eq(ScoredMethod::all())
            && (self.answers.iter()).all(|answer| answer.theta.as_ref().is_none_or(whole))
    }
}

/// Estimate and seconds of one stage of the estimator.
fn of_stage(method: ScoredMethod, estimate: &Estimate) -> (Option<Vec<f64>>, Option<f64>) {
    let (seconds, refit) = (&estimate.seconds, estimate.refit());
    let initial = (Some(estimate.initial.theta.clone()), seconds.predict);
    let refined = refit.map_or(0.0, |refit| refit.seconds.gauss_newton);
    let gauss_newton = seconds.predict + seconds.gate + refined;
    let (theta, seconds) = match method {
        ScoredMethod::GaussNewton => (refit.map(|refit| refit.gauss_newton.clone()), gauss_newton),
        ScoredMethod::TsFine => {
            let tuning = refit.map_or(0.0, |refit| refit.seconds.cloud + refit.seconds.tune);
            (refit.map(|refit| refit.fine.clone()), gauss_newton + tuning)
        }
        // What would have been answered without being told to refine.
        ScoredMethod::Final if estimate.gate.out_of_distribution => {
            (Some(estimate.theta.clone()), seconds.total)
        }
        ScoredMethod::Final => (initial.0, seconds.predict + seconds.gate),
        _ => initial,
    };
    (theta, Some(seconds))
}
