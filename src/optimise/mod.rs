//! Minimisation in a box: all that names argmin, and the only module that does.
//!
//! | for | take |
//! |---|---|
//! | residuals with a Jacobian | [`GaussNewton::minimise`] |
//! | the same with several wells | [`MultiStart::minimise`] |
//! | a scalar without derivatives, few parameters | [`Simplex::minimise`] |
//!
//! What is minimised implements [`ResidualProblem`], or is a closure for [`Simplex`]; it says with [`EvaluationError`] whether
//! a failure costs one point (a twin that diverged) or everything. Nothing here prints or draws unseeded randomness.

mod bounds;
mod box_step;
mod error;
mod gauss_newton;
mod halton;
mod multi_start;
mod problem;
mod simplex;
mod solver;

pub use bounds::{Bounds, BoundsError};
pub use error::OptimiseError;
pub use gauss_newton::{GaussNewton, Minimum, StopReason};
pub use halton::space_filling;
pub use multi_start::{Candidate, MultiStart, Survey};
pub use problem::{EvaluationError, ResidualProblem};
pub use simplex::{ScalarMinimum, Simplex};
