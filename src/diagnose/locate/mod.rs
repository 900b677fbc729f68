//! Where: places, missing functions, maps of the residuals.

pub(in crate::diagnose) mod discover;
pub(in crate::diagnose) mod functions;
pub(in crate::diagnose) mod maps;
