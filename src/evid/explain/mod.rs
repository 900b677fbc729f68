//! Which hypothesis explains the records: screened, refitted, weighed.

pub(in crate::evid) mod decide;
pub(in crate::evid) mod explore;
pub(in crate::evid) mod refit;
pub(in crate::evid) mod scan;
pub(in crate::evid) mod search;
