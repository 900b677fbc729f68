//! The Two-Stage estimator: pretrained on simulations, tested, refined, tuned.
//!
//! [`pretrain`] makes an [`Estimator`] ([`pretrain_on`] of a bank that is there, [`Pretraining`] so that it can be interrupted);
//! [`Estimator::estimate`] takes a record through gate, Gauss–Newton, cloud and tuned heads; [`Estimator::save`] and
//! [`Estimator::load`] keep it in one file.
//!
//! Source: Lakshminarayanan, Guerrero & Rojas, "Fine-Tuning a Simulation-Driven Estimator".

mod calibration;
mod cloud;
mod estimate;
mod estimator;
mod file;
mod pretrain;
mod pretraining;
mod quadratic;
mod readout;
mod scaler;
mod standardiser;
mod tracking;
mod tune;

pub use calibration::{Calibration, Spread};
pub use cloud::{Around, cloud};
pub use estimate::{Estimate, EstimateError, EstimateOptions, INTERVAL_LEVEL, Nuisance, Seconds};
pub use estimator::Estimator;
pub use file::EstimatorFileError;
pub use pretrain::{PretrainError, PretrainOptions, pretrain, pretrain_on};
pub use pretraining::{CHECKPOINT, GivenBank, Pretraining};
pub use readout::Readout;
pub use scaler::Scaler;
pub use standardiser::Standardiser;
pub use tracking::{Tracking, track};
pub use tune::{Tuned, tune};
