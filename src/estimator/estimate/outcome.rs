//! Options and results of an estimate.

use super::tracking::Tracking;
use super::tune::Contributions;
use crate::estimator::bank::Draws;
use crate::estimator::gate::GateOutcome;
use crate::estimator::readout::Spread;
use crate::estimator::recipe::PresetName;
use crate::estimator::refine::Information;
use crate::fit::{FittedNoise, Nuisance, Posterior, Warning};
use crate::record::Record;
use crate::twin::{ParameterSpace, Role};
use serde::Serialize;

/// Codes of warnings that no estimate is consistent with.
pub(super) const NO_BETTER: &str = "no-better-than-constant";
pub(super) const DIVERGES: &str = "free-run-diverges";

/// Options of an estimate.
#[derive(Debug, Clone, Default)]
pub struct EstimateOptions {
    /// Seed of all simulations.
    pub seed: u64,
    /// Numbers of another preset than the estimator's own; features and network stay.
    pub preset: Option<PresetName>,
    /// Refine and tune, though the prior is trusted and the gate agrees.
    pub always_refine: bool,
    /// Take a record whose step is not the study's, and let the twin step as it does.
    pub step_of_record: bool,
    /// A second record to score the calibrated twin on.
    pub validation: Option<Record>,
    /// Number of posterior draws to return, of the likelihood's own fit.
    pub draws: usize,
}

/// Parameters with their errors.
#[derive(Debug, Clone)]
pub(crate) struct Answer {
    pub theta: Vec<f64>,
    pub std_error: Vec<f64>,
    /// Ends of the 90 % interval.
    pub low: Vec<f64>,
    pub high: Vec<f64>,
}

impl Answer {
    pub(super) fn new(theta: Vec<f64>, spread: Spread, space: &ParameterSpace) -> Self {
        let shifted = |by: &[f64]| {
            let moved: Vec<f64> = theta.iter().zip(by).map(|(t, b)| t + b).collect();
            space.clamp(&moved)
        };
        Self {
            low: shifted(&spread.low),
            high: shifted(&spread.high),
            std_error: spread.std_error,
            theta,
        }
    }
}

/// Estimate with the results of its stages. Skipped stages are `None`.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Estimate {
    /// Names of θ: the twin's parameters, then unknown noise levels, starts and magnitudes.
    pub names: Vec<String>,
    /// Role of each parameter.
    pub roles: Vec<Role>,
    /// The network's estimate.
    pub initial: Vec<f64>,
    /// The network's estimate with its errors, for those who trust the prior.
    pub(crate) trusting: Answer,
    /// The test of the network's estimate.
    pub gate: GateOutcome,
    /// Noise levels that the record shows in place of those that the twin declares; simulations take them.
    pub noise: Vec<FittedNoise>,
    /// Gauss–Newton's estimate.
    pub gauss_newton: Option<Vec<f64>>,
    /// The tuned heads' estimate.
    pub fine: Option<Vec<f64>>,
    /// Contributions of layer and heads to it.
    pub(crate) contributions: Option<Contributions>,
    /// The estimate: the record's own, within the bounds. That is the tuned one, unless it is too far from the record's posterior or its
    /// misfit too large: else the posterior's mean, or Gauss–Newton's. The network's is kept where the prior is trusted and the gate
    /// agrees, and where refined ones explain the record worse.
    pub theta: Vec<f64>,
    /// Standard errors of `theta`.
    pub std_error: Vec<f64>,
    /// Ends of the 90 % interval, within the bounds.
    pub low: Vec<f64>,
    /// Upper ends.
    pub high: Vec<f64>,
    /// Information and directions at Gauss–Newton's estimate, or at the network's where the gate kept it.
    pub(crate) information: Option<Information>,
    /// The test after the refit; `None` where no degree of freedom is left.
    pub after: Option<GateOutcome>,
    /// `true` if a refit was made at all.
    pub refitted: bool,
    /// `true` if its answer explains the record worse than the network's, which is kept.
    pub(crate) refinement_refused: bool,
    /// The free run at `theta`, unknown starts refitted; `None` where it diverges.
    pub tracking: Option<Tracking>,
    /// The free run at the network's estimate, for comparison; `None` without a refit, or where it diverges.
    pub tracking_initial: Option<Tracking>,
    /// The free run on the validation record; `None` without one, or where it diverges.
    pub validation: Option<Tracking>,
    /// Draws of everything unknown from likelihood and weak priors, where they were asked for.
    pub posterior: Option<Posterior>,
    /// Reasons for doubt.
    pub warnings: Vec<Warning>,
    /// Simulator calls.
    pub simulations: usize,
    /// The cloud that the heads were tuned on, and measured on: its last rows they never saw.
    pub(crate) cloud: Option<Draws>,
    /// Wall-clock times.
    pub(crate) seconds: Seconds,
}

/// Wall-clock seconds of each stage; `None` for skipped ones.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub(crate) struct Seconds {
    /// Features and network.
    pub predict: f64,
    /// The test.
    pub gate: f64,
    /// Gauss–Newton.
    pub gauss_newton: Option<f64>,
    /// The cloud.
    pub cloud: Option<f64>,
    /// The heads.
    pub tune: Option<f64>,
    /// Everything, free runs included.
    pub total: f64,
}

impl Estimate {
    /// Start states, noise levels and magnitudes among θ.
    pub fn nuisance(&self) -> Vec<Nuisance> {
        (0..self.names.len())
            .filter_map(|j| {
                Some(Nuisance {
                    name: self.roles[j].target(&self.names[j]).into(),
                    role: self.roles[j].nuisance()?,
                    value: self.theta[j],
                    std_error: self.std_error[j],
                })
            })
            .collect()
    }

    /// The twin's own parameters out of a vector over all of θ.
    pub fn physical<T: Clone>(&self, all: &[T]) -> Vec<T> {
        (all.iter().zip(&self.roles))
            .filter(|(_, role)| **role == Role::Parameter)
            .map(|(value, _)| value.clone())
            .collect()
    }

    /// Returns whether the record is what the twin makes at the estimate: no test rejects, and the free run of every output is better
    /// than a constant.
    pub fn is_consistent(&self) -> bool {
        let test = if self.refitted {
            self.after
        } else {
            Some(self.gate)
        };
        test.is_some_and(|test| !test.out_of_distribution) && !self.is_no_better_than_constant()
    }

    /// Returns whether the free run of an output is no better than a constant, or diverges.
    pub(crate) fn is_no_better_than_constant(&self) -> bool {
        let codes = [NO_BETTER, DIVERGES];
        self.warnings.iter().any(|w| codes.contains(&w.code))
    }

    /// Returns whether the answer is the network's.
    pub(crate) fn leans_on_prior(&self) -> bool {
        !self.refitted || self.refinement_refused
    }

    /// Draws of the cloud that were drawn again: out of bounds, diverged, or without features.
    pub fn redrawn(&self) -> usize {
        self.cloud.as_ref().map_or(0, |draws| draws.redrawn)
    }
}
