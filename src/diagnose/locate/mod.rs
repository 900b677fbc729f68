//! Location of a gap: maps, equations, onset, and the missing term.

pub(super) mod discover;
pub(super) mod location;
pub(super) mod missing_term;
pub(super) mod onset;
