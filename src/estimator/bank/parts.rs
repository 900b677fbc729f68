//! Banks in parts.

use super::draws::Draws;
use crate::estimator::error::EstimatorError;
use std::borrow::Cow;

/// Simulations that need not fit into memory at once: rows of parameters and features, in parts.
///
/// Rows are independent draws, so that any set of parts is a sample of the whole.
pub trait Bank: Sync {
    /// Rows of each part, in order.
    fn parts(&self) -> Vec<usize>;

    /// Part number `index`.
    fn part(&self, index: usize) -> Result<Cow<'_, Draws>, EstimatorError>;

    /// All rows.
    fn rows(&self) -> usize {
        self.parts().iter().sum()
    }
}

/// A bank in memory: one part.
impl Bank for Draws {
    fn parts(&self) -> Vec<usize> {
        vec![self.theta.nrows()]
    }

    fn part(&self, _: usize) -> Result<Cow<'_, Draws>, EstimatorError> {
        Ok(Cow::Borrowed(self))
    }
}
