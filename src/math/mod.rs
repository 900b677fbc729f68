//! Statistics and linear algebra that the rest of the crate stands on, in f64.
//!
//! | concept | for |
//! |---|---|
//! | [`Whitening`] | distances between features, in units of their own scatter |
//! | [`quantile`], [`median`], [`rank_p_value`] | empirical distributions |
//! | [`clopper_pearson`] | the probability behind a count of successes |

mod cholesky;
mod clopper_pearson;
mod convert;
mod difference;
mod error;
mod lagged;
mod lanes;
mod least_squares;
mod number;
mod principal_axes;
mod quantile;
mod rounding;
mod sample;
mod solve;
mod svd;
mod whitening;
mod widest;

#[cfg(test)]
pub(crate) use clopper_pearson::binomial_bounds;
pub(crate) use clopper_pearson::clopper_pearson;
pub(crate) use convert::{one_column, one_row, to_array, to_matrix, to_vector};
pub(crate) use difference::Stencil;
pub use error::MathError;
pub(crate) use lagged::{Lagged, LaggedSignals};
pub(crate) use lanes::{LANES, Lanes, Mask};
pub(crate) use least_squares::{LeastSquares, Regression, Regressors};
pub(crate) use number::{Condition, Number};
pub(crate) use principal_axes::principal_axes;
pub(crate) use quantile::{median, quantile, rank_p_value};
pub(crate) use rounding::{six_digits, three_digits};
pub(crate) use sample::{CONSTANT, correlation, deviation, ends, is_constant, largest};
pub(crate) use solve::solve_truncated;
pub(crate) use svd::thin_svd;
pub(crate) use whitening::Whitening;
pub(crate) use widest::{Kernel, widest};
