//! Multi-head networks: all that names dfdx.
//!
//! A network is a shared *trunk* and one *head* for each target. An architecture is written in about ten lines of
//! static dfdx types ([`HeadArchitecture`]); a project takes it by
//! [`with_architecture`](crate::estimator::Project::with_architecture).
//!
//! ```
//! use truetwin::estimator::{PretrainOptions, Project, pretrain};
//! use truetwin::network::layers::*;
//! use truetwin::progress::Progress;
//! use truetwin::study::{RecordPlan, Study};
//! use truetwin::twins::VanDerPol;
//!
//! struct Small;
//! impl HeadArchitecture for Small {
//!     const ID: &'static str = "small";
//!     type Features = Const<4>; // at most four features
//!     type Hidden = Const<16>;
//!     type Trunk = Dense<4, 16, Tanh>;
//!     type Head = (Linear<16, 8>, Tanh, Linear<8, 1>); // plain dfdx layers mix with fused ones
//! }
//!
//! let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 150))?;
//! let project = Project::from(study).with_architecture::<Small>(); // the score: three features
//! let quick = PretrainOptions { bank_size: Some(200), epochs: Some(5), ..PretrainOptions::default() };
//! let (_estimator, history) = pretrain(project, &quick, &Progress::silent())?;
//! assert_eq!(history.epochs_run, 5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Training is repeatable to the bit: initial weights, the holdout split, the order of rows and dropout are pure
//! functions of the seed and of the epoch or step.

mod adam;
mod architectures;
mod checkpoints;
mod data;
mod error;
mod fused;
mod loss;
mod model;
mod multi_head;
mod settings;
mod tensors;
#[cfg(test)]
mod tests;
mod train;

pub use architectures::{Compact, Deep};
pub(crate) use checkpoints::Checkpoints;
pub(crate) use data::Samples;
pub use error::NetworkError;
pub(crate) use fused::{BuiltDense, BuiltNormDense};
pub use fused::{Dense, Leaky, NormDense};
pub(crate) use multi_head::{Architecture, Network, architecture};
pub use settings::{History, Schedule, Training};
pub(crate) use tensors::{NamedTensor, bytes_of, values_of};

use dfdx::prelude::{BuildOnDevice, Const, ConstDim, Cpu, NoneTape, OwnedTape, Tensor};
use model::{FirstWeight, Layers};

/// Layers of an architecture; `use truetwin::network::layers::*` needs no dfdx of your own.
///
/// Plain dfdx layers with their activations, our fused [`Dense`] and [`NormDense`], and [`Leaky`].
pub mod layers {
    pub use super::{Dense, HeadArchitecture, Leaky, NormDense};
    pub use dfdx::nn::builders::{Dropout, LayerNorm1D, LeakyReLU, Linear, ReLU, Tanh};
    pub use dfdx::shapes::Const;
}

/// Training without an estimator, for the bench. Not part of the library's interface.
#[doc(hidden)]
pub mod untyped {
    pub use super::checkpoints::Checkpoints;
    pub use super::data::Samples;
    pub use super::multi_head::{Architecture, Network, architecture};
}

/// A batch of rows of width `C`.
pub(crate) type PlainBatch<C> = Tensor<(usize, C), f32, Cpu, NoneTape>;

/// A batch of rows of width `C` whose gradients are recorded.
pub(crate) type TapedBatch<C> = Tensor<(usize, C), f32, Cpu, OwnedTape<f32, Cpu>>;

/// A network's static shape: what an author writes. See the [module](self) for an example.
///
/// The number of heads is known at run time only, and so is the number of features: rows are padded with zeros to
/// [`Features`](Self::Features), and the first layer starts as wide as if it had only the real ones.
pub trait HeadArchitecture: Send + Sync + 'static {
    /// A name, unique among architectures; it is stored with trained networks.
    const ID: &'static str;
    /// The most features it takes.
    type Features: ConstDim;
    /// Width of the trunk's output, which every head reads.
    type Hidden: ConstDim;
    /// From features to hidden.
    type Trunk: BuildOnDevice<Cpu, f32, Built: Layers<Self::Features, Self::Hidden>>;
    /// From hidden to one target. Its first layer is a `Linear`, a [`Dense`] or a [`NormDense`], nested tuples included.
    type Head: BuildOnDevice<Cpu, f32, Built: Layers<Self::Hidden, Const<1>> + FirstWeight<Self::Hidden>>;
    /// Probability of every dropout, in plain and fused layers alike; at least 0 and below 1, checked at compile time.
    const DROPOUT: f64 = 0.0;
}
