//! The Two-Stage estimator: pretrained on simulations, tested, refined, tuned.
//!
//! [`pretrain`] makes an [`Estimator`]; [`Estimator::estimate`] takes a record
//! through gate, Gauss–Newton, cloud and tuned heads; [`Estimator::save`] and [`Estimator::load`] keep it in one file.
//!
//! Source: Lakshminarayanan, Guerrero & Rojas, "Fine-Tuning a Simulation-Driven Estimator".
//!
//! ```
//! use truetwin::progress::Progress;
//! use truetwin::study::{RecordPlan, Study};
//! use truetwin::record::{Drive, Record};
//! use truetwin::twin::{DigitalTwin, Noise};
//! use truetwin::twins::VanDerPol;
//! use truetwin::estimator::*;
//!
//! let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 200))?;
//! let small = PretrainOptions { bank_size: Some(200), epochs: Some(3), ..PretrainOptions::default() };
//! let (estimator, _history) = pretrain(&study, &small, &Progress::silent())?;
//!
//! // One file, and back.
//! let place = tempfile::tempdir()?;
//! let file = place.path().join("oscillator.est");
//! estimator.save(&file)?;
//! let estimator: Estimator = Estimator::load(&file, &[study])?;
//!
//! // A record of ν = 3, outside of the prior [0, 2.5].
//! let drive = Drive::autonomous(0.05, 200)?;
//! let outputs = VanDerPol.simulate(&[3.0], &drive, Noise::new(7, "measured", 0))?;
//! let record = Record::new(drive, outputs)?;
//! let estimate: Estimate = estimator.estimate(&record)?;
//! assert!(estimate.gate.out_of_distribution && estimate.refit().is_some());
//! assert!((estimate.theta[0] - 3.0).abs() < 5.0 * estimate.std_error[0]);
//! let tracking: &Tracking = estimate.tracking.as_ref().ok_or("the free run is finite")?;
//! assert_eq!(tracking.outputs.dim(), (200, 1));
//! assert!(estimate.nuisance().is_empty()); // no unknown starts, no unknown noise
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod budget;
mod error;
mod estimate;
#[allow(clippy::module_inception)]
mod estimator;
mod file;
mod paper;
mod pretrain;
mod project;
mod readout;
mod settings;

pub(crate) mod bank;
mod gate;
mod refine;
pub(crate) mod shards;

pub use error::EstimatorError;
pub(crate) use estimate::Contributions;
pub use estimate::{Estimate, EstimateOptions, Refit, Together, Tracking};
pub use estimator::Estimator;
pub use gate::GateOutcome;
pub(crate) use pretrain::Pretraining;
pub use pretrain::{PretrainOptions, pretrain};
pub(crate) use project::Recipe;
pub use project::{PresetName, Project};
pub(crate) use readout::INTERVAL_LEVEL;
pub use readout::PointEstimate;
pub use settings::{
    CloudSampler, CloudSettings, GateForm, GateSettings, Inputs, RefineSettings, Settings,
};

#[cfg(test)]
pub(crate) use estimate::Stages;
