//! Fits of a twin and of its variants to records.

pub(super) mod axis;
pub(super) mod base_fit;
pub(super) mod climb;
pub(super) mod first_part;
pub(super) mod growing;
pub(super) mod posterior;
pub(super) mod problem;
pub(super) mod reference;
pub(super) mod slope;
