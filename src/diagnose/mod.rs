//! Diagnosis of the gap between a twin and a record: is there one, where, which effect explains it, how far it closes.
//!
//! | room | question |
//! |---|---|
//! | `run.rs`, `detect.rs`, `summary.rs` | order of the steps, and the summary of their results |
//! | `residuals/` | statistics of innovations, cut by time, state, lag and frequency |
//! | `hypotheses/` | what could be missing: listed effects and disturbances |
//! | `test/` | is anything missing? The statistics of the records against those of simulations |
//! | `explain/` | which effect: fit, order, accept, abstain |
//! | `locate/` | where: equations, time, states, onset; the missing term |
//! | `quantify/` | how far: share closed, smallest visible effect, next input |
//! | `outcome/` | results |
//! | `gain.rs` | gain of a known effect, for trials |
//!
//! The arrows between rooms run one way: residuals ← hypotheses ← test ← explain ← locate, quantify ← run.
//! A twin without equations has its likelihood from [`likelihood::ensemble`](crate::likelihood).
//!
//! See docs/diagnosing-a-gap.md for the mathematics and how to read the answer.

mod context;
mod detect;
mod error;
mod explain;
mod gain;
mod hypotheses;
mod locate;
mod outcome;
mod quantify;
mod residuals;
mod run;
mod settings;
mod summary;
mod test;
mod thresholds;

pub use error::{DiagnoseError, GivenRecord};
pub(crate) use gain::{gain_of, held_out_score};
pub(crate) use outcome::Cell;
pub use outcome::{
    Band, Cause, Channel, Decision, Detection, Diagnosis, Discovery, EffectFit, Equation,
    FittedNuisance, FittedParameter, FreeRuns, Lag, Location, Maps, NextInput, Onset, Region,
    Shrinkage, TargetShare, Term, TermRange, Verdict, Visible, Window,
};
pub(crate) use quantify::held_out::{SHORTEST_SPLIT, held_out_from};
pub use run::diagnose;
pub use settings::DiagnoseSettings;

/// Nats within which explanations are rivals.
pub(crate) const RIVALS: f64 = thresholds::Thresholds::RIVALS;
