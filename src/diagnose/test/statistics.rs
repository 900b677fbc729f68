//! Statistics of records under a fitted twin.

use crate::fit::reference::Gain;

/// All statistics of one set of records, larger where less was expected.
#[derive(Debug, Clone)]
pub(in crate::diagnose) struct Statistics {
    /// √(2·gain) of each candidate.
    pub gains: Vec<f64>,
    pub omnibus: Vec<f64>,
    /// By window and region.
    pub local: Vec<f64>,
    /// Gains of the points.
    pub points: Vec<Gain>,
}
