//! Statistics and linear algebra that the rest of the crate stands on, in f64.
//!
//! | concept | for |
//! |---|---|
//! | [`Whitening`] | distances between features, in units of their own scatter |
//! | [`quantile`], [`median`], [`rank_p_value`] | empirical distributions |
//! | [`clopper_pearson`] | the probability behind a count of successes |

mod cholesky;
mod convert;
mod difference;
mod error;
mod lagged;
mod least_squares;
mod number;
mod order;
mod statistics;
mod svd;
mod whitening;
mod widest;

pub(crate) use convert::{one_row, to_array, to_matrix, to_vector};
pub(crate) use difference::Stencil;
pub use error::MathError;
pub(crate) use lagged::{Lagged, LaggedSignals};
pub(crate) use least_squares::{LeastSquares, Regression, Regressors};
pub(crate) use number::{Condition, LANES, Lanes, Mask, Number, nearest};
pub(crate) use order::{ascending, descending};
pub(crate) use statistics::{
    CONSTANT, clopper_pearson, correlation, deviation, ends, is_constant, largest, log_mean,
    median, norm, quantile, rank_p_value, six_digits, three_digits, unit,
};
pub(crate) use svd::{principal_axes, solve_truncated, thin_svd};
pub(crate) use whitening::Whitening;
pub(crate) use widest::{Kernel, is_wide, wide, widest};

#[cfg(test)]
pub(crate) use statistics::binomial_bounds;
