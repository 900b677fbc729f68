//! Likelihoods of a record: innovations, log-likelihood and score at θ.

pub(crate) mod ensemble;
pub mod kalman;
mod measured;
mod of_twin;
mod time_constants;

pub(crate) use measured::{
    Beliefs, LARGEST_SHARE, Level, Measured, StartElsewhere, measured, rounded, share_name,
    start_elsewhere, with_better_start, with_levels, with_share,
};
pub(crate) use of_twin::{Likelihood, likelihood_of};
pub(crate) use time_constants::time_constants;
