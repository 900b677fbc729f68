//! Likelihoods of a record: innovations, log-likelihood and score at θ.

pub(crate) mod ensemble;
pub mod kalman;
mod measured;
mod of_twin;

pub(crate) use measured::{Beliefs, Level, Measured, measured};
pub(crate) use of_twin::{Likelihood, likelihood_of};
