//! Banks in parts.

use super::draws::Draws;
use crate::estimator::error::EstimatorError;
use std::borrow::Cow;

/// Simulations that need not fit into memory at once: rows of parameters and features, in parts.
///
/// Rows are independent draws, so that any set of parts is a sample of the whole.
///
/// ```
/// use ndarray::array;
/// use truetwin::estimator::bank::{Bank, Draws};
///
/// // Rows in memory are a bank of one part; `shards::ShardedBank` is one of many.
/// let rows = Draws { theta: array![[1.0], [2.0]], features: array![[0.1], [0.2]], redrawn: 0 };
/// assert_eq!((rows.parts(), rows.rows()), (vec![2], 2));
/// assert_eq!(*rows.part(0)?, rows);
/// # Ok::<(), truetwin::estimator::EstimatorError>(())
/// ```
pub trait Bank: Sync {
    /// Rows of each part, in order.
    fn parts(&self) -> Vec<usize>;

    /// Part number `index`.
    ///
    /// # Errors
    ///
    /// A part that cannot be read, or is not what it was.
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
