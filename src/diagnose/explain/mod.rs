//! Which hypothesis explains the records: screened, refitted, weighed.

pub(in crate::diagnose) mod explore;
pub(in crate::diagnose) mod findings;
pub(in crate::diagnose) mod found;
mod noise;
pub(in crate::diagnose) mod pairs;
pub(in crate::diagnose) mod search;
pub(in crate::diagnose) mod terms;
