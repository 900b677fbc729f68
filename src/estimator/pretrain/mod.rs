//! Pretraining: a bank of simulations, and a network trained on it.

mod resumable;
mod train;

pub use resumable::{CHECKPOINT, GivenBank, Pretraining};
pub use train::{PretrainOptions, pretrain, pretrain_on};
