//! Networks whose types are no longer known: the face that the estimator sees.

use super::samples::Samples;
use super::{Checkpoints, History, NamedTensor, NetworkError, Training};
use crate::progress::Progress;
use ndarray::Array2;
use std::fmt::Debug;
use std::sync::Arc;

/// An architecture behind an object-safe face; made by [`architecture`](super::architecture).
pub trait Architecture: Send + Sync + Debug {
    /// [`HeadArchitecture::ID`](super::HeadArchitecture::ID).
    fn id(&self) -> &'static str;

    /// The most features that it takes.
    fn max_features(&self) -> usize;

    /// Trains a new network on samples that the caller has standardised, by Adam on the loss of [`Training`]. The same
    /// arguments give the same bits. Ticks the stage `train` once an epoch.
    ///
    /// Samples that come in several parts may be larger than memory: at most 64 MiB are held at a time. The last parts are then held out,
    /// and each epoch takes the others in a new order, with the rows in memory shuffled.
    ///
    /// A training that was interrupted goes on with what `checkpoints` have kept of it, to the same bits.
    fn train_on(
        &self,
        samples: &dyn Samples,
        settings: &Training,
        seed: u64,
        checkpoints: &Checkpoints,
        progress: &Progress,
    ) -> Result<(Arc<dyn Network>, History), NetworkError>;

    /// Puts a network of `inputs` features and `outputs` heads together from [`Network::weights`]. The error names the first
    /// tensor that is missing, surplus, of another shape, or not finite.
    fn restore(
        &self,
        inputs: usize,
        outputs: usize,
        weights: &[NamedTensor],
    ) -> Result<Arc<dyn Network>, NetworkError>;
}

/// A trained network. It never changes: tuning makes another one.
pub trait Network: Send + Sync + Debug {
    /// Number of features, n.
    fn inputs(&self) -> usize;

    /// Number of heads, d.
    fn outputs(&self) -> usize;

    /// Predictions (samples × d) from `features` (samples × n), without dropout.
    ///
    /// A sample's prediction may differ in its last bits (1e-6) with the number of samples that come along.
    fn predict(&self, features: &Array2<f64>) -> Result<Array2<f64>, NetworkError>;

    /// The trunk's outputs (samples × hidden width), without dropout.
    fn hidden(&self, features: &Array2<f64>) -> Result<Array2<f64>, NetworkError>;

    /// A network with the same trunk, and heads trained further on `features` and `targets`.
    ///
    /// The trunk is evaluated once, without dropout; then only the heads train, on its output, starting where they are.
    /// Ticks the stage `tune` once an epoch.
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
