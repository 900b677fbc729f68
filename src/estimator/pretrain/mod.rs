//! Pretraining: a bank of simulations, and a network trained on it.

mod resumable;
#[cfg(test)]
mod tests;
mod train;

pub(crate) use resumable::GivenBank;
pub use resumable::Pretraining;
pub use train::{PretrainOptions, pretrain};
