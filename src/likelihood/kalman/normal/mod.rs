//! Normal numbers of which something is cut: held in an interval, or known to lie in one.

pub(super) mod cell;
pub(super) mod clip;
pub(super) mod tail;
