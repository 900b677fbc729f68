//! The structural test: statistics of records against those of simulations of the fitted twin.

pub(super) mod fitted_twin;
pub(super) mod free_run;
pub(super) mod null;
pub(super) mod shared;
pub(super) mod statistics;
