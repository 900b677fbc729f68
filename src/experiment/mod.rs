//! Studies over many records, and the paper's settings of the reference twins.
//!
//! | to … | look at |
//! |---|---|
//! | run the estimator and the baselines on many simulated records | [`MonteCarlo::run`], [`Run`] |
//! | turn the runs into errors and coverage | [`score`], [`Scores`] |
//! | choose where true parameters come from | [`Scenario`] |
//! | keep runs in a folder and go on later | [`MonteCarlo::folder`] |
//! | draw what the answers predict | [`FreeRuns`], [`MeanRuns`] |
//! | have a twin's test points, invariants, published figures | [`Benchmark`] |

mod folder;
mod free_runs;
mod invariant;
mod method;
mod monte_carlo;
mod paper;
mod record;
mod run;
mod scenario;
mod score;

pub use folder::Origin;
pub use free_runs::{FreeRuns, MeanRuns};
pub use invariant::{Invariant, Symmetry};
pub use method::Method;
pub use monte_carlo::{MonteCarlo, MonteCarloError};
pub use paper::reference_studies;
pub use run::{Answer, Run};
pub use scenario::{Benchmark, Published, Scenario, ScenarioError, TestPoint};
pub use score::{COVERAGE_LEVEL, Coverage, MethodScore, Scores, score};
