//! Minimisation in a box: all that names argmin, and the only module that does.
//!
//! | for | take |
//! |---|---|
//! | residuals with a Jacobian | [`GaussNewton::minimise`] |
//! | starts that are spread over a box | [`space_filling`] |
//!
//! What is minimised implements [`ResidualProblem`]; it says with [`MathError`](crate::math::MathError) whether a failure costs one point (a
//! twin that diverged) or everything. Nothing here prints or draws unseeded randomness.

mod bounds;
mod box_step;
mod gauss_newton;
mod halton;
mod problem;
mod settings;
mod solver;

pub use bounds::Bounds;
pub use halton::space_filling;
pub use problem::ResidualProblem;
pub use settings::GaussNewton;
