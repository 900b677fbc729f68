//! Sizes: share of the gap closed, smallest visible effect, next input, calibration.

pub(in crate::diagnose) mod calibrate;
pub(in crate::diagnose) mod free_run;
pub(in crate::diagnose) mod horizon;
pub(in crate::diagnose) mod next_input;
pub(in crate::diagnose) mod power;
pub(crate) mod share;
