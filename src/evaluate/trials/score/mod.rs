//! Scores of all trials.

mod baselines;
mod bins;
mod card;
mod closed;
mod count;
mod said;

pub(crate) use baselines::Baseline;
pub(crate) use bins::Bin;
pub use card::Scorecard;
pub(crate) use card::Setup;
pub(crate) use count::Count;

#[cfg(test)]
mod tests;
