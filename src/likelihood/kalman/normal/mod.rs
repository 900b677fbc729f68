//! Normal numbers of which something is cut: held in an interval, or known to lie in one.

mod cell;
pub(super) mod clip;
mod range;
pub(super) mod tail;

/// Density, mean and variance of z ~ N(0, 1) given what a reading tells of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Known {
    /// log of the density of the reading, times √2π: 0 at most for a reading that is z itself.
    pub log_density: f64,
    pub mean: f64,
    pub variance: f64,
}
