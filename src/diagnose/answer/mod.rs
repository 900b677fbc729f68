//! The answer of a diagnosis, derived once, from posterior mass; reports only read it.
//!
//! | file | holds |
//! |---|---|
//! | `posterior.rs` | posterior probabilities of sets, names, places and kinds, from log Z as pure data |
//! | `decide.rs` | verdict, decision, accepted effects and their rivals |
//! | `findings.rs` | what the search found, as that data |
//! | `summary.rs` | effects, parameters and what remains, for the report |

pub(in crate::diagnose) mod decide;
mod findings;
pub(in crate::diagnose) mod posterior;
pub(in crate::diagnose) mod summary;
#[cfg(test)]
pub(crate) mod tests;

pub(in crate::diagnose) use decide::Answer;
pub(in crate::diagnose) use posterior::Hypotheses;
