//! Multi-head networks: all that names dfdx.
//!
//! A network is a shared *trunk* and one *head* for each target. An architecture is written in about ten lines of
//! static dfdx types ([`HeadArchitecture`]); everything else sees only [`Architecture`], [`Network`] and matrices of
//! `f64` with one sample a row.
//!
//! ```
//! use ndarray::Array2;
//! use truetwin::network::{Training, architecture, layers::*};
//! use truetwin::progress::Progress;
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
//! let features = Array2::from_shape_fn((64, 3), |(i, j)| ((i * 7 + j * 5) % 16) as f64 / 8.0 - 1.0);
//! let targets = features.dot(&ndarray::array![[1.0, 0.5], [0.0, -0.5], [-1.0, 0.0]]);
//! let settings = Training { epochs: 5, ..Training::default() };
//! let (network, history) =
//!     architecture::<Small>().train(&features, &targets, &settings, 1, &Progress::silent())?;
//! assert_eq!((network.inputs(), network.outputs()), (3, 2));
//! assert_eq!(network.predict(&features)?.dim(), (64, 2));
//! assert_eq!(history.epochs_run, 5);
//! # Ok::<(), truetwin::network::NetworkError>(())
//! ```
//!
//! Training is repeatable to the bit: initial weights, the holdout split, the order of rows and dropout are pure
//! functions of the seed and of the epoch or step.

mod adam;
mod architectures;
mod checkpoints;
mod error;
mod feed;
mod first_weight;
mod fused;
mod loss;
mod model;
mod multi_head;
mod rows;
mod samples;
mod seed;
mod settings;
mod tensors;
#[cfg(test)]
mod tests;
mod train;

pub use architectures::{Compact, Deep};
pub use checkpoints::Checkpoints;
pub use error::NetworkError;
pub use first_weight::FirstWeight;
pub use fused::{Activation, Dense, Leaky, NormDense};
pub(crate) use fused::{BuiltDense, BuiltNormDense};
pub use multi_head::architecture;
pub use samples::{Part, Samples};
pub use settings::{History, Schedule, Training};
pub use tensors::NamedTensor;
pub(crate) use tensors::{bytes_of, values_of};

use crate::progress::Progress;
use dfdx::prelude::{
    BuildOnDevice, Const, ConstDim, Cpu, CpuError, Module, ModuleMut, NoneTape, OwnedTape, Tensor,
    TensorCollection,
};
use ndarray::Array2;
use samples::Matrices;
use std::fmt::Debug;
use std::sync::Arc;

/// Layers of an architecture; `use truetwin::network::layers::*` needs no dfdx of your own.
///
/// Plain dfdx layers with their activations, our fused [`Dense`] and [`NormDense`], and [`Leaky`].
pub mod layers {
    pub use super::{Dense, HeadArchitecture, Leaky, NormDense};
    pub use dfdx::nn::builders::{Dropout, LayerNorm1D, LeakyReLU, Linear, ReLU, Tanh};
    pub use dfdx::shapes::Const;
}

/// A batch of rows of width `C`.
pub(crate) type Batch<C> = Tensor<(usize, C), f32, Cpu, NoneTape>;

/// A batch of rows of width `C` whose gradients are recorded.
pub(crate) type TapedBatch<C> = Tensor<(usize, C), f32, Cpu, OwnedTape<f32, Cpu>>;

/// Layers on a device that map rows of width `I` to rows of width `O`, with and without a tape.
///
/// Implemented for all that qualifies: dfdx layers, fused layers and tuples of them.
///
/// ```
/// use dfdx::prelude::{Const, Cpu};
/// use truetwin::network::Layers;
///
/// /// An own layer qualifies where this compiles.
/// fn qualifies<T: Layers<Const<4>, Const<2>>>() {}
/// qualifies::<dfdx::nn::modules::Linear<4, 2, f32, Cpu>>();
/// ```
pub trait Layers<I: ConstDim, O: ConstDim>:
    TensorCollection<f32, Cpu, To<f32, Cpu> = Self>
    + Clone
    + Send
    + Sync
    + Module<Batch<I>, Output = Batch<O>, Error = CpuError>
    + ModuleMut<TapedBatch<I>, Output = TapedBatch<O>, Error = CpuError>
    + 'static
{
}

impl<I: ConstDim, O: ConstDim, T> Layers<I, O> for T where
    T: TensorCollection<f32, Cpu, To<f32, Cpu> = T>
        + Clone
        + Send
        + Sync
        + Module<Batch<I>, Output = Batch<O>, Error = CpuError>
        + ModuleMut<TapedBatch<I>, Output = TapedBatch<O>, Error = CpuError>
        + 'static
{
}

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
    /// From hidden to one target. Its first layer must have a weight that [`FirstWeight`] reaches.
    type Head: BuildOnDevice<Cpu, f32, Built: Layers<Self::Hidden, Const<1>> + FirstWeight<Self::Hidden>>;
    /// Probability of every dropout, in plain and fused layers alike; at least 0 and below 1, checked at compile time.
    const DROPOUT: f64 = 0.0;
}

/// An architecture behind an object-safe face; made by [`architecture`].
///
/// ```
/// use std::sync::Arc;
/// use truetwin::network::{Architecture, Compact, NetworkError, architecture};
///
/// let compact: Arc<dyn Architecture> = architecture::<Compact>();
/// assert_eq!((compact.id(), compact.max_features()), ("compact", 16));
/// assert!(matches!(compact.restore(17, 1, &[]), Err(NetworkError::TooManyFeatures { .. })));
/// ```
pub trait Architecture: Send + Sync + Debug {
    /// [`HeadArchitecture::ID`].
    fn id(&self) -> &'static str;

    /// The most features that it takes.
    fn max_features(&self) -> usize;

    /// Trains a new network on `features` (samples × n) and `targets` (samples × d), both standardised by the caller.
    ///
    /// Minimises the loss of [`Training`] by Adam. The same arguments give the same bits. Ticks the stage `train` once
    /// an epoch.
    ///
    /// # Errors
    ///
    /// A wrong setting, sizes that do not fit each other or the architecture, numbers that are not finite, a loss that
    /// diverges, or a listener that cancels.
    fn train(
        &self,
        features: &Array2<f64>,
        targets: &Array2<f64>,
        settings: &Training,
        seed: u64,
        progress: &Progress,
    ) -> Result<(Arc<dyn Network>, History), NetworkError> {
        let samples = Matrices { features, targets };
        self.train_on(&samples, settings, seed, &Checkpoints::none(), progress)
    }

    /// As [`train`](Self::train), on samples that need not fit into memory: of samples of more than 64 MiB that come in
    /// several parts, no more than that are held at a time. The last parts are held out then; each epoch has the others in
    /// an order of its own, rows in an order of their own among those that are in memory together. Fewer samples are trained
    /// on as in [`train`](Self::train), to the same bits.
    ///
    /// A training that was interrupted goes on with what `checkpoints` have kept of it, to the same bits, too.
    ///
    /// # Errors
    ///
    /// As [`train`](Self::train), [`NetworkError::Samples`] for a part that cannot be read, and
    /// [`NetworkError::Checkpoint`] where the state cannot be written.
    fn train_on(
        &self,
        samples: &dyn Samples,
        settings: &Training,
        seed: u64,
        checkpoints: &Checkpoints,
        progress: &Progress,
    ) -> Result<(Arc<dyn Network>, History), NetworkError>;

    /// Puts a network of `inputs` features and `outputs` heads together from [`Network::weights`].
    ///
    /// # Errors
    ///
    /// Names the first tensor that is missing, surplus, of another shape, or not finite.
    fn restore(
        &self,
        inputs: usize,
        outputs: usize,
        weights: &[NamedTensor],
    ) -> Result<Arc<dyn Network>, NetworkError>;
}

/// A trained network. It never changes: tuning makes another one.
///
/// ```
/// use ndarray::{Array2, array};
/// use truetwin::network::{Compact, NamedTensor, Training, architecture};
/// use truetwin::progress::Progress;
///
/// let features = Array2::from_shape_fn((64, 2), |(i, j)| ((i * 7 + j * 5) % 16) as f64 / 8.0 - 1.0);
/// let targets = features.dot(&array![[1.0], [-0.5]]);
/// let quick = Training { epochs: 3, ..Training::default() };
///
/// let compact = architecture::<Compact>();
/// let (network, _) = compact.train(&features, &targets, &quick, 1, &Progress::silent())?;
///
/// // Weights leave a network by name and come back to the same predictions.
/// let weights: Vec<NamedTensor> = network.weights();
/// assert_eq!(weights[0].name, "trunk.0.weight");
/// let again = compact.restore(2, 1, &weights)?;
/// assert_eq!(again.predict(&features)?, network.predict(&features)?);
///
/// // Tuning leaves the trunk alone and makes another network.
/// let (tuned, _) = network.tune_heads(&features, &targets, &quick, 1, &Progress::silent())?;
/// assert_eq!(tuned.hidden(&features)?, network.hidden(&features)?);
/// # Ok::<(), truetwin::network::NetworkError>(())
/// ```
pub trait Network: Send + Sync + Debug {
    /// Number of features, n.
    fn inputs(&self) -> usize;

    /// Number of heads, d.
    fn outputs(&self) -> usize;

    /// Predictions (samples × d) from `features` (samples × n), without dropout.
    ///
    /// A sample's prediction may differ in its last bits (1e-6) with the number of samples that come along.
    ///
    /// # Errors
    ///
    /// Features of another width, or not finite.
    fn predict(&self, features: &Array2<f64>) -> Result<Array2<f64>, NetworkError>;

    /// The trunk's outputs (samples × hidden width), without dropout.
    ///
    /// # Errors
    ///
    /// Features of another width, or not finite.
    fn hidden(&self, features: &Array2<f64>) -> Result<Array2<f64>, NetworkError>;

    /// A network with the same trunk, and heads trained further on `features` and `targets`.
    ///
    /// The trunk is evaluated once, without dropout; then only the heads train, on its output, starting where they are.
    /// Ticks the stage `tune` once an epoch.
    ///
    /// # Errors
    ///
    /// As [`Architecture::train`].
    fn tune_heads(
        &self,
        features: &Array2<f64>,
        targets: &Array2<f64>,
        settings: &Training,
        seed: u64,
        progress: &Progress,
    ) -> Result<(Arc<dyn Network>, History), NetworkError>;

    /// All tensors, by names such as `trunk.0.weight` and `heads.2.1.gamma`, in a fixed order.
    fn weights(&self) -> Vec<NamedTensor>;
}
