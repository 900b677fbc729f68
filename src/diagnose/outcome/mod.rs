//! Results of a diagnosis.

mod location;
mod predictive;
mod warnings;

pub(crate) use location::Cell;
pub use location::{
    Band, Channel, Lag, Location, Maps, MissingFunction, Onset, Region, TargetShare, Window,
};

pub use predictive::{Burst, HiddenDisturbance, Predicted, PredictiveCheck};
pub(in crate::diagnose) use warnings::warnings;

use crate::fit::{Nuisance, Warning};
use crate::record::{Drive, Record, Signal};
use crate::twin::{Hold, Integrator, Interval, Parameter};
use serde::ser::{SerializeStruct, Serializer};
use serde::{Deserialize, Serialize};

/// Kind of gap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The twin explains the record with parameters within the prior.
    NoGap,
    /// It does with parameters outside of the prior.
    ParameterGap,
    /// No parameters explain the record.
    StructuralGap,
}

impl Verdict {
    /// Id in reports.
    pub fn id(self) -> &'static str {
        match self {
            Self::NoGap => "no-gap",
            Self::ParameterGap => "parameter-gap",
            Self::StructuralGap => "structural-gap",
        }
    }
}

/// Decision about the cause.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Decision {
    /// One effect, or an accepted pair.
    Named,
    /// Rivals that the data cannot tell apart.
    Class,
    /// Listed effects explain most; something unknown remains.
    Partial,
    /// No listed effect, nor a pair of them, explains the record.
    NoneOfThese,
    /// Parameters outside of the prior explain the record, and so does a listed effect with parameters inside.
    Absorbed,
    /// Nothing needs a cause.
    NotNeeded,
}

impl Decision {
    /// Id in reports.
    pub fn id(self) -> &'static str {
        match self {
            Self::Named => "named",
            Self::Class => "class",
            Self::Partial => "partial",
            Self::NoneOfThese => "none-of-these",
            Self::Absorbed => "absorbed",
            Self::NotNeeded => "not-needed",
        }
    }
}

/// Evidence for a gap: something is missing against nothing is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Detection {
    /// log of the odds that something is missing, in nats, prior odds even: a gap above 3.
    pub log_evidence: f64,
    /// Share of records simulated by the fitted twin with as much evidence; none unless asked for. Where no simulation has as much, an
    /// upper bound: [`Detection::at_floor`].
    pub p_value: Option<f64>,
    /// Number of these records.
    pub simulations: usize,
    /// True where no simulation has as much evidence: p is below `p_value`.
    pub at_floor: bool,
    /// Level of the test whether θ left its prior.
    pub alpha: f64,
}

/// One parameter of the twin.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FittedParameter {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// The estimator's first estimate.
    pub initial: Option<f64>,
    /// Fitted to the twin without effects.
    pub alone: f64,
    /// Refitted, beside accepted effects.
    pub refitted: f64,
    /// Standard deviation by information and weak prior.
    pub std_error: f64,
    /// Ends of the 90 % interval, inside the bounds.
    pub interval: [f64; 2],
    /// True where the record determines it better than the prior.
    pub identified: bool,
    /// The prior box.
    pub prior: Interval,
    /// The physical bounds.
    pub bounds: Interval,
}

impl FittedParameter {
    /// The parameter of the twin.
    pub(crate) fn parameter(&self) -> Parameter {
        Parameter::new(&self.name, &self.unit, self.prior.low(), self.prior.high())
            .within(self.bounds.low(), self.bounds.high())
    }
}

/// One listed effect, fitted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectFit {
    /// Id of the effect.
    pub id: String,
    /// Its target.
    pub target: String,
    /// Posterior probability that it is missing, alone or beside others.
    pub probability: f64,
    /// Names and values, those held at an infinite off value included.
    #[serde(serialize_with = "as_map")]
    pub magnitudes: Vec<(String, f64)>,
    /// log of the evidence over that of the twin, in nats; for the members of an accepted set, that of the set.
    pub log_evidence: f64,
    /// Other effects that do the same in this twin, as `id@target`: the probability is that of all these names together.
    pub also: Vec<String>,
}

impl EffectFit {
    /// `id@target`.
    pub fn key(&self) -> String {
        crate::effect::EffectKey::new(&self.id, &self.target).to_string()
    }
}

/// Cause of the gap: the effect that the twin lacks.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cause {
    /// The decision.
    pub decision: Decision,
    /// Best first.
    pub effects: Vec<EffectFit>,
    /// Effects added to the twin.
    pub accepted: Vec<String>,
    /// Rivals that the data cannot tell apart, the accepted among them.
    pub class: Vec<String>,
    /// Probabilities of the kinds of explanation.
    pub probabilities: Probabilities,
    /// Unknown rest on top of the accepted, or else the best, effects.
    pub remains: Option<Remains>,
    /// A record that would split the class; none where there is no class, or no input splits it.
    pub next_input: Option<NextInput>,
}

/// Posterior probabilities; they add up to one.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Probabilities {
    /// Listed effects explain everything.
    pub listed: f64,
    /// Listed effects explain a part.
    pub partial: f64,
    /// Nothing listed is missing, but something is.
    pub unknown: f64,
    /// Nothing is missing.
    pub nothing: f64,
}

impl Probabilities {
    /// The same, adding up to one.
    pub(in crate::diagnose) fn normalised(self) -> Self {
        let sum = self.listed + self.partial + self.unknown + self.nothing;
        Self {
            listed: self.listed / sum,
            partial: self.partial / sum,
            unknown: self.unknown / sum,
            nothing: self.nothing / sum,
        }
    }
}

/// Something unknown on top of effects.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Remains {
    /// Its most probable place.
    pub place: String,
    /// Nats that it adds.
    pub log_evidence: f64,
    /// Its share of all nats.
    pub share: f64,
}

/// A record to measure next, so that rivals are told apart.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "file", rename = "next-input.csv")]
pub struct NextInput {
    /// Kind of input.
    pub kind: String,
    /// The rivals, as `id@target`.
    pub rivals: Vec<String>,
    /// Inputs and length of it.
    #[serde(flatten, serialize_with = "size")]
    pub drive: Drive,
    /// Simulated pairs of the present record and such a next one: those whose true rival stood out, and all.
    #[serde(serialize_with = "share_of")]
    pub split: [u64; 2],
    /// The same with the present inputs measured once more.
    #[serde(serialize_with = "share_of")]
    pub again: [u64; 2],
}

/// A sparse law for a missing function: exploratory, not a test.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Discovery {
    /// Place of the function.
    #[serde(flatten, serialize_with = "exploratory")]
    pub equation: String,
    /// Variable of the function.
    pub variable: String,
    /// Terms by how often draws of the function include them.
    pub terms: Vec<Term>,
    /// Share of the function's variance that the terms explain.
    pub explained: f64,
}

/// One term of a regression.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Term {
    /// Such as `h1²` or `u`.
    pub name: String,
    /// Its factor, in the unit of the equation.
    pub coefficient: f64,
    /// 90 % of the coefficients of draws that include it.
    pub interval: [f64; 2],
    /// Share of draws that include it.
    pub inclusion: f64,
}

/// The smallest magnitude of a listed effect that records like these reveal in 80 of 100 cases.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Visible {
    /// Id of the effect.
    pub id: String,
    /// Its target.
    pub target: String,
    /// Name of the magnitude that is meant.
    pub magnitude: String,
    /// Its value; none where no magnitude in reach would be seen.
    pub value: Option<f64>,
}

/// Free runs beside a record, for pictures.
#[derive(Debug, Clone, PartialEq)]
pub struct FreeRuns {
    /// Instants, in seconds.
    pub times: Vec<f64>,
    /// Measured outputs.
    pub measured: Signal,
    /// Free run of the refitted twin.
    pub before: Option<Signal>,
    /// The same with the accepted effects.
    pub after: Option<Signal>,
}

/// Result of a diagnosis.
#[derive(Debug, Clone, Serialize)]
#[serde(tag = "schema", rename = "truetwin.gap/2")]
pub struct Diagnosis {
    /// Name of the twin.
    pub twin: String,
    /// Kind of gap.
    pub verdict: Verdict,
    /// The test.
    pub detection: Detection,
    /// Comparison of the records with simulated ones, where nothing missing was found; none otherwise, and where simulations cost too much.
    pub check: Option<PredictiveCheck>,
    /// The twin's own parameters.
    pub parameters: Vec<FittedParameter>,
    /// All other estimates.
    pub nuisance: Vec<Nuisance>,
    /// Location of the gap.
    #[serde(rename = "where")]
    pub location: Location,
    /// Cause of the gap.
    #[serde(rename = "which")]
    pub cause: Cause,
    /// Extent on held-out data, if there are any.
    pub shrinkage: Option<Shrinkage>,
    /// Sparse law for the missing function, where something unknown is missing.
    pub discovery: Option<Discovery>,
    /// Sensors and states whose noise is correlated, as the records ask for.
    pub correlated_noise: Vec<String>,
    /// Sensors whose noise grows with the signal, as the records ask for.
    pub proportional_noise: Vec<String>,
    /// Sensors whose noise has outliers, as the records ask for.
    pub outliers: Vec<String>,
    /// True for a quick look: effects were tried one at a time.
    pub quick: bool,
    /// True if the search was cancelled before its end.
    pub interrupted: bool,
    /// Integrator that the diagnosis used, where the records ask for a finer step than the twin's.
    pub integrator: Option<Integrator>,
    /// Its substeps of a sample.
    pub substeps: Option<usize>,
    /// Rule for inputs between samples that the diagnosis used in place of the twin's, as the records ask for.
    pub hold: Option<Hold>,
    /// Smallest visible magnitude of each listed effect.
    pub power: Vec<Visible>,
    /// Number of explanations tested: listed effects and unknown functions.
    pub candidates: usize,
    /// Effects of this twin that were not tested, as `id@target`.
    pub not_tested: Vec<String>,
    /// Reasons to doubt the result.
    pub warnings: Vec<Warning>,
    /// Passes over a record, of a filter or an ensemble, that the diagnosis took, without those of `--calibrate`: its cost on any machine.
    pub passes: u64,
    /// Wall-clock seconds.
    pub seconds: f64,
    /// Each record with one-step residuals in the place of its outputs: prediction errors of the twin with the accepted effects, over their
    /// standard deviation.
    #[serde(skip)]
    pub residuals: Vec<Record>,
    /// Free runs beside the first record.
    #[serde(skip)]
    pub free_runs: FreeRuns,
    /// Free runs beside the validation record.
    #[serde(skip)]
    pub validation_runs: Option<FreeRuns>,
}

impl Diagnosis {
    /// The disturbance that fitted noise had swallowed, if any.
    pub fn disturbance(&self) -> Option<&HiddenDisturbance> {
        self.check.as_ref()?.disturbance.as_ref()
    }
}

/// Prediction errors over one horizon, on held-out data: root mean squares over the standard deviation of the output.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Horizon {
    /// Samples ahead; none for the free run.
    pub samples: Option<usize>,
    /// The same in seconds.
    pub seconds: Option<f64>,
    /// The refitted twin's alone.
    pub before: f64,
    /// That of the same with the accepted effects.
    pub after: f64,
    /// To be expected of records that the accepted twin makes, noise and all.
    pub floor: f64,
    /// (before² − after²)/(before² − floor²): the true system has 1 in expectation; none where the floor's own spread reaches the error
    /// before.
    pub closed: Option<f64>,
}

/// Prediction errors before and after, on held-out data, at the horizon where twin and floor differ most clearly.
#[derive(Debug, Clone)]
pub struct Shrinkage {
    /// Measure: [`Shrinkage::PREDICTION`], [`Shrinkage::FREE_RUN`] or [`Shrinkage::LOG_SCORE`].
    pub metric: &'static str,
    /// Error of the refitted twin alone.
    pub before: f64,
    /// The same with the accepted effects.
    pub after: Option<f64>,
    /// Error by noise alone: what records simulated from the accepted twin have.
    pub floor: Option<f64>,
    /// Share of the expected squared error that closes ([`Horizon::closed`]); none where its interval is too wide for one number.
    pub closed: Option<f64>,
    /// 90 % interval of the share, from records that the accepted twin simulates; not clamped.
    pub interval: Option<[f64; 2]>,
    /// Held-out data: `validation record` or `last third of the record`.
    pub held_out: &'static str,
    /// The same error at the prior's centre or the estimator's first estimate, without any refit.
    pub unfitted: Option<f64>,
    /// The same error with the best effect outside the class, fitted alike: what a wrong effect gains.
    pub placebo: Option<f64>,
    /// The same errors of effects drawn at random.
    pub random: Vec<f64>,
    /// Horizon in seconds; none for a free run.
    pub horizon: Option<f64>,
    /// All horizons, shortest first, the free run last.
    pub horizons: Vec<Horizon>,
    /// Mean log density of a held-out sample in nats, before and after.
    pub log_score: Option<[f64; 2]>,
}

impl Shrinkage {
    /// Root mean square of predictions over a horizon, over the standard deviation of the output.
    pub const PREDICTION: &str = "prediction NRMSE";
    /// Root mean square of a free run's error over the standard deviation of the output.
    pub const FREE_RUN: &str = "free-run NRMSE";
    /// Mean log density of a sample, for effects that move no free run.
    pub const LOG_SCORE: &str = "held-out log score";

    /// Errors after and of noise alone, where these are too close for a share: it has no interval, or one that holds all and nothing.
    pub(crate) fn hidden_by_noise(&self) -> Option<(f64, f64)> {
        let is_open = |[low, high]: [f64; 2]| low <= 0.0 && high >= 1.0;
        (self.after.zip(self.floor)).filter(|_| self.interval.is_none_or(is_open))
    }
}

impl Serialize for Shrinkage {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Controls<'s> {
            unfitted: Option<f64>,
            theta_only: f64,
            placebo: Option<f64>,
            random: &'s [f64],
        }
        let mut object = serializer.serialize_struct("Shrinkage", 11)?;
        object.serialize_field("metric", self.metric)?;
        object.serialize_field("before", &self.before)?;
        object.serialize_field("after", &self.after)?;
        object.serialize_field("floor", &self.floor)?;
        object.serialize_field("closed", &self.closed)?;
        object.serialize_field("interval", &self.interval)?;
        object.serialize_field("held_out", self.held_out)?;
        let controls = Controls {
            unfitted: self.unfitted,
            theta_only: self.before,
            placebo: self.placebo,
            random: &self.random,
        };
        object.serialize_field("controls", &controls)?;
        object.serialize_field("horizon", &self.horizon)?;
        object.serialize_field("horizons", &self.horizons)?;
        object.serialize_field("log_score", &self.log_score)?;
        object.end()
    }
}

/// Writes names and values as one object.
fn as_map<S: Serializer>(pairs: &[(String, f64)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(pairs.iter().map(|(name, value)| (name, value)))
}

/// Writes the length of a record.
fn size<S: Serializer>(drive: &Drive, serializer: S) -> Result<S::Ok, S::Error> {
    let mut object = serializer.serialize_struct("Size", 2)?;
    object.serialize_field("samples", &drive.samples())?;
    object.serialize_field("step", &drive.dt())?;
    object.end()
}

/// Writes a count and the number of cases.
fn share_of<S: Serializer>([count, of]: &[u64; 2], serializer: S) -> Result<S::Ok, S::Error> {
    let mut object = serializer.serialize_struct("Count", 2)?;
    object.serialize_field("count", count)?;
    object.serialize_field("of", of)?;
    object.end()
}

/// Marks a regression as exploratory.
fn exploratory<S: Serializer>(equation: &str, serializer: S) -> Result<S::Ok, S::Error> {
    let mut object = serializer.serialize_struct("Exploratory", 2)?;
    object.serialize_field("exploratory", &true)?;
    object.serialize_field("equation", equation)?;
    object.end()
}
