//! Where the cloud of fresh simulations around an estimate is drawn from.

mod eigenbox;
mod ellipsoid;
mod hybrid;
mod sensitivity;

pub use eigenbox::EigenBox;
pub use ellipsoid::{Ellipsoid, EllipsoidError};
pub use hybrid::Hybrid;
pub use sensitivity::Sensitivity;

use crate::twin::Noise;
use nalgebra::DVector;

/// Draws parameters around an estimate.
///
/// Bounds are not a sampler's business: whoever simulates the cloud rejects what is outside, draws again with
/// other noise, and counts.
pub trait Sampler: Send + Sync {
    /// Draw number `index`, which depends on it and on `noise` alone.
    fn draw(&self, index: u64, noise: Noise) -> DVector<f64>;
}
