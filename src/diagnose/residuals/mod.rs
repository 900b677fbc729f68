//! Innovations cut by time, value, lag and frequency: maps in time, states, lags and frequency.

pub(super) mod correlation;
pub(super) mod cut;
pub(super) mod local;
pub(super) mod shares;
