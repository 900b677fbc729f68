//! Likelihoods of a record: innovations, log-likelihood and score at θ.

pub mod kalman;
