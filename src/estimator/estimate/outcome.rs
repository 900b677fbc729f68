//! Options and results of an estimate.

use super::tracking::Tracking;
use crate::estimator::bank::Draws;
use crate::estimator::gate::GateOutcome;
use crate::estimator::recipe::PresetName;
use crate::estimator::refine::Information;
use crate::fit::Nuisance;
use crate::record::Record;
use crate::twin::Role;
use serde::Serialize;

/// Options of an estimate.
#[derive(Debug, Clone, Default)]
pub struct EstimateOptions {
    /// Seed of all simulations.
    pub seed: u64,
    /// Numbers of another preset than the estimator's own; features and network stay.
    pub preset: Option<PresetName>,
    /// Refine and tune whatever the gate says.
    pub always_refine: bool,
    /// A second record to score the calibrated twin on.
    pub validation: Option<Record>,
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
    /// The test of the network's estimate.
    pub gate: GateOutcome,
    /// Gauss–Newton's estimate.
    pub gauss_newton: Option<Vec<f64>>,
    /// The tuned heads' estimate.
    pub fine: Option<Vec<f64>>,
    /// The estimate: the network's where the gate kept it, else the tuned one unless its misfit is too large, else
    /// Gauss–Newton's.
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
    /// The free run at `theta`, unknown starts refitted; `None` where it diverges.
    pub tracking: Option<Tracking>,
    /// The free run at the network's estimate, for comparison; `None` without a refit, or where it diverges.
    pub tracking_initial: Option<Tracking>,
    /// The free run on the validation record; `None` without one, or where it diverges.
    pub validation: Option<Tracking>,
    /// Simulator calls.
    pub simulations: usize,
    /// The cloud that the heads were tuned on, and measured on: its last rows they never saw.
    pub(crate) cloud: Option<Draws>,
    /// Wall-clock times.
    pub seconds: Seconds,
}

/// Wall-clock seconds of each stage; `None` for skipped ones.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
#[non_exhaustive]
pub struct Seconds {
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

    /// Draws of the cloud that were drawn again: out of bounds, diverged, or without features.
    pub fn redrawn(&self) -> usize {
        self.cloud.as_ref().map_or(0, |draws| draws.redrawn)
    }
}
