//! Statistics of innovations: whiteness, and maps in time, states, lags and frequency.

pub(super) mod correlation;
pub(super) mod cut;
pub(super) mod local;
pub(super) mod omnibus;
pub(super) mod shares;
