//! Result of a fit.

use super::evidence::Evidence;
use super::posterior::{Posterior, PosteriorRegion};
use super::profile::Profile;
use crate::record::Signal;
use crate::twin::{Noise, Parameter, Role, Side, Stepping, StepsTaken};
use serde::Serialize;

/// Settings of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct FitSettings {
    /// Seed of random starts and of the draws that correct the evidence.
    pub seed: u64,
    /// Level of the intervals, in (0, 1).
    pub level: f64,
    /// Number of posterior draws to return; each costs four likelihoods, of a black box an ensemble of simulations each.
    pub draws: usize,
    /// Profile likelihoods of all parameters; otherwise only of those whose posterior the prior shapes.
    pub profile: bool,
    /// Where progress cancels the fit behind its search: give the answer without the stages that are left, marked as
    /// [interrupted](Fit::interrupted), in place of an error.
    pub give_partial: bool,
}

impl FitSettings {
    /// Source of everything random.
    pub(crate) fn noise(&self) -> Noise {
        Noise::new(self.seed, "fit", 0)
    }
}

impl Default for FitSettings {
    fn default() -> Self {
        Self {
            seed: 1,
            level: 0.9,
            draws: 0,
            profile: false,
            give_partial: false,
        }
    }
}

/// The most probable parameters of a twin, given its records.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct Fit {
    /// Parameters and magnitudes of effects.
    pub parameters: Vec<FittedValue>,
    /// Noise levels of states (per √s) and outputs.
    pub noise: Vec<FittedNoise>,
    /// States at the first sample of each record, given the whole record; empty for a twin without equations.
    pub starts: Vec<FittedStart>,
    /// Level of the intervals.
    pub level: f64,
    /// log p(y | θ), in nats.
    pub log_likelihood: f64,
    /// The likelihood averaged over the prior, in nats; none where it cannot be told.
    pub evidence: Option<FitEvidence>,
    /// End of the search.
    pub convergence: Convergence,
    /// Errors of each output, over the records that have it.
    pub errors: Vec<OutputErrors>,
    /// Reasons for doubt.
    pub warnings: Vec<Warning>,
    /// Draws of everything unknown, where they were asked for.
    #[serde(skip)]
    pub posterior: Option<Posterior>,
    /// Profile likelihoods: of all parameters where they were asked for, otherwise of those whose intervals hold theirs.
    pub profiles: Vec<Profile>,
    /// Substeps, and the rule for inputs between samples, that the fit used in place of the twin's, as the records ask for; none otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stepping: Option<Stepping>,
    /// Adaptive substeps of free runs from the twin's own start, over all records; none for fixed steps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<StepsTaken>,
    /// Number of samples of all records.
    pub samples: usize,
    /// Wall time in seconds.
    pub seconds: f64,
    /// `true` where progress cancelled the fit behind its search: what was not yet asked of the records stands as without, intervals may be of
    /// first order.
    pub interrupted: bool,
    /// Innovations of each record in their own units, N × outputs: independent N(0, 1) if the twin is right.
    #[serde(skip)]
    pub residuals: Vec<Signal>,
    /// Free run beside each record, N × outputs; none where it diverges.
    #[serde(skip)]
    pub free_runs: Vec<Option<Signal>>,
    /// Region of the twin's own parameters; none where there are none.
    #[serde(skip)]
    pub(crate) region: Option<PosteriorRegion>,
}

/// A parameter, or a magnitude of an effect.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct FittedValue {
    /// Name, as in study files.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Most probable value; infinite for an end of a range that the readings do not show.
    pub value: f64,
    /// Standard error, first order, 0 where the readings show the value; with the interval, not a number where the search has not arrived.
    pub std_error: f64,
    /// Lower end of the interval, which holds the value.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
    /// `true` where the interval holds that of the profile likelihood beside that of the posterior, since the prior pulls the value by a quarter of
    /// its error, or makes the interval 5 % narrower.
    pub by_profile: bool,
    /// The bound that the value lies at.
    pub at_bound: Option<Side>,
}

impl FittedValue {
    /// A magnitude that the readings show, and that is not fitted: at the bound of its parameter, it is off without end.
    pub(super) fn shown(p: &Parameter, value: f64) -> Self {
        let value = match value {
            low if low <= p.bounds.low() => f64::NEG_INFINITY,
            high if high >= p.bounds.high() => f64::INFINITY,
            within => within,
        };
        Self {
            name: p.name.clone(),
            unit: p.unit.clone(),
            value,
            std_error: 0.0,
            low: value,
            high: value,
            by_profile: false,
            at_bound: None,
        }
    }

    /// Takes error and interval back: about a point that is no top they say nothing.
    pub(super) fn withhold_error(&mut self) {
        (self.std_error, self.low, self.high) = (f64::NAN, f64::NAN, f64::NAN);
    }
}

/// A fitted noise level.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct FittedNoise {
    /// State or output; `y.share` is the share of |y| that is added to the level of `y`.
    pub name: String,
    /// `process` or `measurement`.
    pub role: &'static str,
    /// Unit of the level.
    pub unit: String,
    /// Most probable level.
    pub value: f64,
    /// Standard error of the level, first order.
    pub std_error: f64,
    /// Level that the twin or its study declares.
    pub declared: Option<f64>,
    /// The bound that the level lies at: rounding at the lower one, or what an output that stops at an end of its range needs.
    pub at_bound: Option<Side>,
}

/// An unknown start, noise level or magnitude that a study estimates beside the twin's parameters.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Nuisance {
    /// State, output, or magnitude of an effect.
    pub name: String,
    /// A start, a noise level, or the magnitude of an effect.
    pub role: Role,
    /// Estimate.
    pub value: f64,
    /// Standard error.
    pub std_error: f64,
}

/// A state at the first sample of a record.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct FittedStart {
    /// Record, from 1.
    pub record: usize,
    /// State.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Mean given the whole record.
    pub value: f64,
    /// Standard deviation given the whole record.
    pub std_error: f64,
}

/// Evidence of a twin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FitEvidence {
    /// log Z, in nats.
    pub log_evidence: f64,
    /// log Z by Laplace's approximation alone.
    pub laplace: f64,
    /// Standard error of what draws correct; none where Laplace stands alone.
    pub std_error: Option<f64>,
    /// Number of independent draws that the correction is worth.
    pub effective_draws: f64,
    /// log Z over that of the twin with its fitted effects off: what they gain; none where none are fitted.
    pub gained: Option<f64>,
}

impl From<Evidence> for FitEvidence {
    fn from(of: Evidence) -> Self {
        Self {
            log_evidence: of.log_evidence,
            laplace: of.laplace,
            std_error: of.error,
            effective_draws: of.effective,
            gained: None,
        }
    }
}

/// The end of a search.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Convergence {
    /// `true` where the gradient is gone and more than one search ended here, or the only one.
    pub converged: bool,
    /// Distance to the top, in standard deviations.
    pub distance: f64,
    /// Searches that ended at the same top.
    pub agreeing: usize,
    /// All searches.
    pub searches: usize,
}

/// Errors of one output over all records.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct OutputErrors {
    /// Output.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Root mean square of the one-step prediction errors.
    pub one_step: f64,
    /// Correlation of one-step errors, each in its own standard deviation, with those of the row before: near 0 where the noise is what it
    /// is taken for; none of fewer than three pairs of rows.
    pub correlation: Option<f64>,
    /// Root mean square of record − free run, from the start given the record; none where a run diverges.
    pub free_run: Option<f64>,
    /// Standard deviation of the record: what a constant would reach.
    pub deviation: f64,
}

/// Code of the warning that a search has not arrived.
pub(crate) const NOT_CONVERGED: &str = "not-converged";

/// Something that makes the result doubtful.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Warning {
    /// Kind, for programs.
    pub code: &'static str,
    /// The problem, for people.
    pub what: String,
    /// Advice.
    pub remedy: &'static str,
}
