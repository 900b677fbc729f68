//! Diagnosis of the gap between a twin and a record: is there one, where, which effect explains it, how far it closes.
//!
//! | room | question |
//! |---|---|
//! | `run.rs`, `base.rs` | order of the steps; the fitted twin that they begin with |
//! | `rounds.rs` | the search, again with another kind of noise or a finer step |
//! | `long.rs` | long records: searched in part, fitted whole |
//! | `greedy.rs` | a baseline: forward selection by BIC |
//! | `known.rs` | the share that effects close which are known to be there |
//! | `step.rs` | whether a finer step of the integrator explains the records better |
//! | `candidates.rs` | effects that the study lets a diagnosis name |
//! | `explain/` | which hypotheses of the engine (`hypothesis`): weighed, compared |
//! | `answer/` | the answer: posterior of what was found, decision, names, places |
//! | `residuals/` | innovations cut by time, state, lag and frequency |
//! | `locate/` | where: places, missing functions, maps of the residuals |
//! | `quantify/` | how far: share closed, smallest visible effect, next input, calibration |
//! | `outcome/` | results |
//!
//! Everything is decided by evidence: the likelihood of the records averaged over what is unknown, noise levels and starts included.
//! See docs/diagnosing-a-gap.md for the mathematics and how to read the answer.

pub(crate) mod answer;
mod base;
mod candidates;
mod explain;
#[cfg(test)]
pub(crate) mod fixture;
mod greedy;
mod known;
mod locate;
mod long;
mod outcome;
mod quantify;
mod residuals;
mod rounds;
mod run;
mod settings;
mod step;
mod thresholds;

pub(crate) use greedy::greedy;
pub(crate) use known::true_fit;
pub(crate) use outcome::Cell;
pub use outcome::{
    Band, Cause, Channel, Decision, Detection, Diagnosis, Discovery, EffectFit, FittedParameter,
    FreeRuns, Horizon, Lag, Location, Maps, MissingFunction, NextInput, Onset, Probabilities,
    Region, Remains, Shrinkage, TargetShare, Term, Verdict, Visible, Window,
};
pub(crate) use quantify::share::SHORTEST_SPLIT;
pub use run::diagnose;
pub use settings::{Ablation, DiagnoseSettings};

/// Nats within which explanations are rivals.
pub(crate) const RIVALS: f64 = thresholds::Thresholds::RIVALS;
/// Level of the intervals.
pub(crate) const INTERVAL_LEVEL: f64 = thresholds::Thresholds::INTERVAL_LEVEL;
