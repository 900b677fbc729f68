//! Likelihoods of a record: innovations, log-likelihood and score at θ.

pub(crate) mod ensemble;
pub mod kalman;
