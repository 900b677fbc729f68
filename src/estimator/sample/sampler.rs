//! Samplers of parameters around an estimate.

use crate::twin::Noise;
use nalgebra::DVector;

/// Draws parameters around an estimate.
///
/// A sampler ignores bounds: the cloud rejects draws outside, draws again with other noise, and counts them.
pub trait Sampler: Send + Sync {
    /// Returns draw number `index`, which depends on it and on `noise` alone.
    fn draw(&self, index: u64, noise: Noise) -> DVector<f64>;
}
