//! Studies over many records, and the paper's settings of the reference twins.
//!
//! The verb `reproduce` runs them ([docs/benchmarks.md](../../../../../docs/benchmarks.md)). An embedding crate takes the twins:
//!
//! ```
//! use truetwin::evaluate::paper::reference_studies;
//!
//! let names: Vec<String> = reference_studies()?.iter().map(|study| study.name().to_owned()).collect();
//! assert_eq!(names, ["van-der-pol", "tanks"]);
//! # Ok::<(), truetwin::study::StudyError>(())
//! ```

mod benchmark;
mod free_runs;
mod monte_carlo;
mod presets;
mod run;
mod scenario;
mod score;

pub(crate) use benchmark::{Benchmark, ScoredMethod};
use benchmark::{Invariant, Published, Symmetry, TestPoint};
pub(crate) use free_runs::{AnswerRuns, MeanRuns};
pub(crate) use monte_carlo::{MonteCarlo, Origin};
pub use presets::{reference_projects, reference_studies};
pub(crate) use run::BenchmarkRun;
pub(crate) use scenario::Scenario;
pub(crate) use score::{Coverage, MethodScore, PointScore, Scores, score};
