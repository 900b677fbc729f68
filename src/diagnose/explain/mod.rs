//! Fits of the explanations, their order, and the decision.

pub(super) mod attribute;
pub(super) mod decide;
pub(super) mod evalue;
pub(super) mod extended;
pub(super) mod frequency;
pub(super) mod several;
pub(super) mod verdict;
