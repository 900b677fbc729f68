//! Statistics and linear algebra that the rest of the crate stands on, in f64.
//!
//! | concept | for |
//! |---|---|
//! | [`Whitening`] | distances between features, in units of their own scatter |
//! | [`quantile`], [`median`], [`rank_p_value`] | empirical distributions |
//! | [`clopper_pearson`], [`binomial_bounds`] | what a count of successes says, and what it may be |

mod cholesky;
mod clopper_pearson;
mod difference;
mod error;
mod lagged;
mod least_squares;
mod quantile;
mod rounding;
mod sample;
mod solve;
mod svd;
mod whitening;
mod widest;

pub use clopper_pearson::{binomial_bounds, clopper_pearson};
pub(crate) use difference::Stencil;
pub use error::MathError;
pub(crate) use lagged::{Lagged, LaggedSignals};
pub(crate) use least_squares::{Fit, LeastSquares, Regressors};
pub use quantile::{median, quantile, rank_p_value};
pub(crate) use rounding::six_digits;
pub(crate) use sample::{deviation, ends, largest};
pub(crate) use solve::solve_above;
pub(crate) use solve::solve_truncated;
pub use whitening::Whitening;
pub(crate) use widest::{Kernel, widest};
