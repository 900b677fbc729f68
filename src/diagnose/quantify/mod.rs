//! Extent of a gap: share closed on held-out data, power, next input.

pub(super) mod held_out;
pub(super) mod next_input;
pub(super) mod power;
