//! Explanations of a gap: listed effects and disturbances, as twins with magnitudes to fit.

pub(super) mod candidate;
pub(super) mod choice;
pub(super) mod dictionary;
pub(super) mod disturbed_equations;
pub(super) mod disturbed_signals;
pub(super) mod entry;
pub(super) mod plan;
pub(super) mod scales;
pub(super) mod variant;
