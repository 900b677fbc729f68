//! Hypotheses of what a twin lacks, and their fit beside it: one engine for fits with effects and for diagnoses.
//!
//! | file | question |
//! |---|---|
//! | `term.rs`, `set.rs` | one term that a twin may lack; a set of terms by their keys |
//! | `listed.rs`, `alike.rs` | effects of the library, in the units of the record; those that are one term of the equations |
//! | `unknown.rs`, `functions.rs`, `basis.rs` | unknown functions and disturbances at every place |
//! | `trace.rs`, `remembered.rs` | unknown functions of what signals leave behind: lags and plays |
//! | `responses.rs` | waves that are locked to a signal |
//! | `noise.rs` | other kinds of noise |
//! | `scales.rs`, `magnitude.rs` | sizes of signals, states, rates and effects; ranges of magnitudes |
//! | `search/` | all terms screened, the promising ones fitted |
//! | `search/model.rs`, `explanation.rs` | a twin with a set of terms, fitted: its evidence |
//! | `search/screen.rs` | promise of each term along a grid of its magnitudes, before any fit |
//! | `search/traces.rs` | functions of traces screened by first-order responses, without a pass for any of them |
//! | `search/fits.rs`, `fold.rs`, `valleys.rs` | fits of a term from all starts: answered, annealed, from the prior's centre, unfolded, from other laws' tops |
//! | `search/breadth.rs`, `frequencies.rs` | how many terms are fitted; frequencies that residuals show |
//! | `search/effects.rs` | a fit with the effects of a study |

mod alike;
pub(crate) mod basis;
pub(crate) mod entry;
pub(crate) mod functions;
pub(crate) mod limits;
pub(crate) mod listed;
mod magnitude;
pub(crate) mod noise;
mod remembered;
mod responses;
pub(crate) mod scales;
pub(crate) mod search;
pub(crate) mod set;
pub(crate) mod term;
pub(crate) mod trace;
pub(crate) mod unknown;

use self::term::Term;
use std::sync::Arc;

pub(crate) use alike::merged;

/// Terms that several models hold.
pub(crate) fn shared(terms: Vec<Term>) -> Vec<Arc<Term>> {
    terms.into_iter().map(Arc::new).collect()
}
