//! Posterior of θ given the records, by draws.
//!
//! | file | question |
//! |---|---|
//! | `sampler.rs` | draws weighed by a density, and proposals that follow them |
//! | `resampling.rs` | equally likely draws of θ |
//! | `table.rs` | the same with first states, as people get them |
//! | `spread.rs` | errors and intervals |
//! | `region.rs` | mean and principal axes of the twin's own parameters |

mod region;
mod resampling;
mod sampler;
mod spread;
mod table;

pub(crate) use region::PosteriorRegion;
pub(crate) use resampling::{DrawsAsked, PosteriorSample, posterior};
pub(in crate::fit) use sampler::{Proposal, Round, effective};
pub(crate) use spread::FitIntervals;
pub use table::Posterior;
pub(in crate::fit) use table::table;
