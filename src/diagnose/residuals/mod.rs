//! Innovations cut by time, value, lag and frequency: maps in time, states, lags and frequency.

pub(super) mod cut;
pub(super) mod excess;
pub(super) mod shares;
