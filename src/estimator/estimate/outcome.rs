//! Options and results of an estimate.

use super::tracking::Tracking;
use crate::estimator::bank::Draws;
use crate::estimator::gate::GateOutcome;
use crate::estimator::project::PresetName;
use crate::estimator::readout::PointEstimate;
use crate::estimator::refine::FeatureInformation;
use crate::fit::doubts::{DIVERGES, NO_BETTER};
use crate::fit::{FittedNoise, Nuisance, Posterior, Warning};
use crate::record::Record;
use crate::twin::Role;
use serde::{Deserialize, Serialize};

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

/// Stages after the gate at the network's estimate.
#[derive(Debug, Clone)]
pub(crate) enum Stages {
    /// The prior is trusted and the gate agrees: the network's estimate is the answer. Holds the record's information there; `None`
    /// where the features do not tell it.
    Kept(Option<FeatureInformation>),
    /// The record was refitted.
    Refitted(Box<Refit>),
}

/// Contributions of the quadratic layer and the heads to a tuned estimate, by parameter; measured on draws that neither saw.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Contributions {
    /// α, the share of what the heads say that holds; the layer alone has 0.
    pub alpha: Vec<f64>,
    /// Share of the cloud's variance that the layer alone explains.
    pub layer: Vec<f64>,
    /// The same of layer and heads.
    pub both: Vec<f64>,
    /// The layer's estimate alone, within the bounds.
    pub theta: Vec<f64>,
}

/// Refit of a record: Gauss–Newton, cloud, tuned heads, the test again.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Refit {
    /// The record's own estimate: the tuned one, unless it is too far from the record's posterior or its misfit too large; else the
    /// posterior's mean, or Gauss–Newton's.
    pub answer: PointEstimate,
    /// `true` if that explains the record worse than the network's estimate, which is then kept.
    pub is_refused: bool,
    /// Gauss–Newton's estimate.
    pub gauss_newton: Vec<f64>,
    /// The tuned heads' estimate.
    pub fine: Vec<f64>,
    /// Contributions of layer and heads to it; `None` without a quadratic layer.
    pub(crate) contributions: Option<Contributions>,
    /// Information and directions at Gauss–Newton's estimate.
    pub(crate) information: FeatureInformation,
    /// The test of the answer; `None` where no degree of freedom is left.
    pub after: Option<GateOutcome>,
    /// The free run at the network's estimate, for comparison; `None` where it diverges.
    pub tracking_initial: Option<Tracking>,
    /// The cloud that the heads were tuned on, and measured on: its last rows they never saw.
    pub(crate) cloud: Draws,
    pub(crate) seconds: RefitSeconds,
}

/// Wall-clock seconds of the stages of a refit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RefitSeconds {
    pub gauss_newton: f64,
    pub cloud: f64,
    /// Tuning of the heads.
    pub tune: f64,
}

/// Wall-clock seconds of an estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Seconds {
    /// Features and network.
    pub predict: f64,
    /// The record's fit and the test at the network's estimate.
    pub gate: f64,
    /// Everything, free runs included.
    pub total: f64,
}

/// Estimate with the results of its stages.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Estimate {
    /// Names of θ: the twin's parameters, then unknown noise levels, starts and magnitudes.
    pub names: Vec<String>,
    /// Role of each parameter.
    pub roles: Vec<Role>,
    /// The network's estimate, for those who trust the prior.
    pub initial: PointEstimate,
    /// The test of the network's estimate.
    pub gate: GateOutcome,
    /// Stages after that test.
    pub(crate) stages: Stages,
    /// Noise levels that the record shows in place of those that the twin declares; simulations take them.
    pub noise: Vec<FittedNoise>,
    /// The estimate: the refit's, or the network's where that was kept.
    pub theta: Vec<f64>,
    /// Standard errors of `theta`.
    pub std_error: Vec<f64>,
    /// Ends of the 90 % interval, within the bounds.
    pub low: Vec<f64>,
    /// Upper ends.
    pub high: Vec<f64>,
    /// The free run at `theta`, unknown starts refitted; `None` where it diverges.
    pub tracking: Option<Tracking>,
    /// The free run on the validation record; `None` without one, or where it diverges.
    pub validation: Option<Tracking>,
    /// Draws of everything unknown from likelihood and weak priors, where they were asked for.
    pub posterior: Option<Posterior>,
    /// Reasons for doubt.
    pub warnings: Vec<Warning>,
    /// Simulator calls.
    pub simulations: usize,
    pub(crate) seconds: Seconds,
}

impl Estimate {
    /// The refit, where one was made.
    pub fn refit(&self) -> Option<&Refit> {
        match &self.stages {
            Stages::Kept(_) => None,
            Stages::Refitted(refit) => Some(refit),
        }
    }

    #[cfg(test)]
    pub(crate) fn refit_mut(&mut self) -> &mut Refit {
        match &mut self.stages {
            Stages::Kept(_) => panic!("not refitted"),
            Stages::Refitted(refit) => refit,
        }
    }

    /// The test after the refit; `None` without one, or where no degree of freedom is left.
    pub fn after(&self) -> Option<GateOutcome> {
        self.refit().and_then(|refit| refit.after)
    }

    /// Information and directions at Gauss–Newton's estimate, or at the network's where the gate kept it.
    pub(crate) fn information(&self) -> Option<&FeatureInformation> {
        match &self.stages {
            Stages::Kept(information) => information.as_ref(),
            Stages::Refitted(refit) => Some(&refit.information),
        }
    }

    /// Start states, noise levels and magnitudes among θ.
    pub fn nuisance(&self) -> Vec<Nuisance> {
        (0..self.names.len())
            .filter(|j| self.roles[*j] != Role::Parameter)
            .map(|j| Nuisance {
                name: self.roles[j].target(&self.names[j]).into(),
                role: self.roles[j],
                value: self.theta[j],
                std_error: self.std_error[j],
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

    /// Returns whether the record is what the twin makes at the estimate: the last test does not reject, and the free run of every output
    /// is better than a constant.
    pub fn is_consistent(&self) -> bool {
        let test = match self.refit() {
            Some(refit) => refit.after,
            None => Some(self.gate),
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
        self.refit().is_none_or(|refit| refit.is_refused)
    }

    /// Draws of the cloud that were drawn again: out of bounds, diverged, or without features.
    pub fn redrawn(&self) -> usize {
        self.refit().map_or(0, |refit| refit.cloud.redrawn)
    }
}
