//! Diagnosis of the gap between a twin and a record: is there one, where, which effect explains it, how far it closes.
//!
//! | room | question |
//! |---|---|
//! | `run.rs`, `report.rs` | entry; everything that is reported of a search |
//! | `base.rs`, `prior.rs` | the fitted twin that a search begins with; the same within its prior |
//! | `feedback.rs` | inputs that a controller makes of the outputs |
//! | `greedy.rs` | a baseline: forward selection by BIC |
//! | `true_effects.rs` | the share that effects close which are known to be there |
//! | `step.rs` | whether a finer step of the integrator explains the records better |
//! | `candidates.rs` | effects that the study lets a diagnosis name |
//! | `search/` | which hypotheses of the engine (`hypothesis`) explain the records: one map, one loop |
//! | `answer/` | the answer: posterior of what was found, decision, names, places |
//! | `residuals/` | innovations cut by time, state, lag and frequency |
//! | `locate/` | where: places, missing functions, maps of the residuals |
//! | `predictive/` | do records that the fitted twin simulates look like the measured ones |
//! | `quantify/` | how far: share closed, smallest visible effect, next input, calibration |
//! | `outcome/` | results |
//!
//! Everything is decided by evidence: the likelihood of the records averaged over what is unknown, noise levels and starts included.
//! See docs/diagnosing-a-gap.md for the mathematics and how to read the answer.

pub(crate) mod answer;
mod base;
mod candidates;
mod feedback;
#[cfg(test)]
pub(crate) mod fixture;
mod greedy;
mod locate;
mod outcome;
mod predictive;
mod prior;
mod quantify;
mod report;
mod residuals;
mod run;
mod search;
mod settings;
mod step;
mod thresholds;
mod true_effects;

pub(crate) use greedy::greedy;
pub(crate) use outcome::Cell;
pub use outcome::{
    Band, Burst, Cause, Channel, Decision, Detection, Diagnosis, Discovery, EffectFit,
    FittedParameter, FreeRuns, HiddenDisturbance, Horizon, Lag, Location, Maps, MissingFunction,
    NextInput, Onset, Predicted, PredictiveCheck, Probabilities, Region, Remains, Shrinkage,
    TargetShare, Term, Verdict, Visible, Window,
};
pub(crate) use quantify::share::SHORTEST_SPLIT;
pub use run::diagnose;
pub use settings::{Ablation, DiagnoseSettings};
pub(crate) use thresholds::THRESHOLDS;
pub(crate) use true_effects::true_fit;
