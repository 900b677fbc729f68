//! Training data of a network.

use ndarray::Array2;
use std::borrow::Cow;
use std::error::Error;

/// Features (rows × n) and targets (rows × d) of one part.
pub type Part<'a> = (Cow<'a, Array2<f64>>, Cow<'a, Array2<f64>>);

/// Rows of features and targets, both standardised, that need not fit into memory at once: they come in parts.
///
/// Rows are independent of each other and alike, so that any parts are a sample of the whole.
pub trait Samples: Sync {
    /// Features of a row, n.
    fn features(&self) -> usize;

    /// Targets of a row, d.
    fn targets(&self) -> usize;

    /// Rows of each part, in order.
    fn parts(&self) -> Vec<usize>;

    /// Part number `index`; it is asked for once an epoch.
    ///
    /// # Errors
    ///
    /// What keeps it from being read.
    fn part(&self, index: usize) -> Result<Part<'_>, Box<dyn Error + Send + Sync>>;
}

/// Samples in memory.
pub(super) struct Matrices<'a> {
    pub features: &'a Array2<f64>,
    pub targets: &'a Array2<f64>,
}

impl Samples for Matrices<'_> {
    fn features(&self) -> usize {
        self.features.ncols()
    }

    fn targets(&self) -> usize {
        self.targets.ncols()
    }

    fn parts(&self) -> Vec<usize> {
        vec![self.features.nrows()]
    }

    fn part(&self, _: usize) -> Result<Part<'_>, Box<dyn Error + Send + Sync>> {
        Ok((Cow::Borrowed(self.features), Cow::Borrowed(self.targets)))
    }
}
