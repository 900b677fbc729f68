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
    fn part(&self, index: usize) -> Result<Part<'_>, Box<dyn Error + Send + Sync>>;
}

/// Samples in memory.
impl Samples for (&Array2<f64>, &Array2<f64>) {
    fn features(&self) -> usize {
        self.0.ncols()
    }

    fn targets(&self) -> usize {
        self.1.ncols()
    }

    fn parts(&self) -> Vec<usize> {
        vec![self.0.nrows()]
    }

    fn part(&self, _: usize) -> Result<Part<'_>, Box<dyn Error + Send + Sync>> {
        Ok((Cow::Borrowed(self.0), Cow::Borrowed(self.1)))
    }
}
