//! Studies over many records, and the paper's settings of the reference twins.
//!
//! | to … | look at |
//! |---|---|
//! | run the estimator and the baselines on many simulated records | [`MonteCarlo::run`], [`Run`] |
//! | turn the runs into errors and coverage | [`score`], [`Scores`] |
//! | choose where true parameters come from | [`Scenario`] |
//! | have a twin's test points, invariants, published figures | [`Benchmark`] |
//!
//! ```
//! use truetwin::evaluate::paper::*;
//! use truetwin::progress::Progress;
//! use truetwin::study::{RecordPlan, Study};
//! use truetwin::twins::VanDerPol;
//! use truetwin::estimator::{PretrainOptions, pretrain};
//!
//! let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 150))?;
//! let small = PretrainOptions { bank_size: Some(200), epochs: Some(3), ..PretrainOptions::default() };
//! let (estimator, _) = pretrain(&study, &small, &Progress::silent())?;
//!
//! // A twin of one's own has no published points; true parameters come from all of its bounds.
//! let plan = MonteCarlo { benchmark: Benchmark::default(), scenario: Scenario::Uniform, runs: 2, seed: 1 };
//! let runs: Vec<Run> = plan.run(&estimator, &Progress::silent())?;
//! let scores: Scores = score(&study, &plan, &runs);
//! assert_eq!((scores.methods[0].method, scores.methods[0].failed), (Method::TsPre, 0));
//! assert_eq!(scores.coverage[0].of, 2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod folder;
mod free_runs;
mod invariant;
#[cfg(test)]
mod limits;
mod method;
mod monte_carlo;
mod presets;
mod record;
mod run;
mod scenario;
mod score;

pub use crate::evaluate::baseline::Initialisation;
pub(crate) use folder::Origin;
pub(crate) use free_runs::{AnswerRuns, MeanRuns};
use invariant::{Invariant, Symmetry};
pub use method::Method;
pub use monte_carlo::MonteCarlo;
pub use presets::{reference_projects, reference_studies};
pub use run::Run;
pub use scenario::{Benchmark, Scenario};
use scenario::{Published, TestPoint};
pub(crate) use score::COVERAGE_LEVEL;
pub use score::{Scores, score};
