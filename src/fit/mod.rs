//! Fits of a twin to measured records: one engine for estimates, diagnoses and baselines.
//!
//! | file | question |
//! |---|---|
//! | `run.rs`, `outcome.rs` | a fit from beginning to end, and its result |
//! | `searched.rs` | its searches and where they ended |
//! | `problem.rs`, `axis.rs` | what is unknown, in which bounds, and what is known before |
//! | `score.rs` | how well a fit predicts a record that it has not seen |
//! | `follow.rs` | how the fitted twin follows its records |
//! | `budget.rs` | cost and tolerances of a fit, and the count of its passes |
//! | `starts/` | where does a search begin |
//! | `solver.rs` | the one solver, on argmin |
//! | `climb.rs`, `kinks.rs` | the most probable θ, also where the likelihood has kinks |
//! | `certificate.rs` | has the search arrived, and what lies at a bound |
//! | `evidence.rs` | the likelihood averaged over the prior |
//! | `profile.rs` | what the records alone say of a parameter |
//! | `absent.rs` | what the records say for the fitted effects |
//! | `hold.rs` | the rule for inputs between samples that the records ask for |
//! | `reference.rs` | linear gain of a direction beside θ |
//! | `doubts.rs` | reasons to doubt a result, in one list |
//! | `posterior/` | draws of θ given the records, as a table, as errors and intervals, as a region |
//! | `least_squares/` | the solver on residuals |

mod absent;
pub(crate) mod axis;
mod budget;
pub(crate) mod certificate;
pub(crate) mod climb;
pub(crate) mod doubts;
pub(crate) mod evidence;
pub(crate) mod follow;
mod hold;
mod kinks;
pub(crate) mod least_squares;
mod outcome;
pub(crate) mod posterior;
pub(crate) mod problem;
mod profile;
pub(crate) mod reference;
mod run;
mod score;
mod searched;
mod solver;
pub(crate) mod starts;

pub use crate::twin::Side;
pub(crate) use budget::{FitStages, ITERATIONS, Passes};
pub(crate) use hold::other_hold;
pub(crate) use outcome::NOT_CONVERGED;
pub use outcome::{
    Convergence, Fit, FitEvidence, FitSettings, FittedNoise, FittedStart, FittedValue, Nuisance,
    OutputErrors, Warning,
};
pub use posterior::Posterior;
pub use profile::Profile;
pub(crate) use profile::{ProfilesOf, depth};
pub(crate) use run::{Subject, run};
pub use score::FitScore;
pub(crate) use score::score;
pub(crate) use searched::{Searched, WithoutEffects, fits};
pub(crate) use starts::spectral_starts;
