//! Price of a second effect.

use super::thresholds::Thresholds;

/// Nats that each effect beside the first one costs.
#[derive(Clone, Copy)]
pub(in crate::diagnose) struct Price {
    /// −log of the prior probability that a pair is what is missing, over that of one effect.
    pub prior: f64,
    /// A share of what the first law explains: integrators and discretisation differ by as much.
    pub fine_print: f64,
}

impl Price {
    /// The price among so many listed effects, of which the best alone explains `top` nats.
    pub fn new(listed: usize, top: f64) -> Self {
        let pairs = 0.5 * (listed as f64 - 1.0);
        let second = Thresholds::SECOND * Thresholds::LISTED / pairs.max(1.0);
        Self {
            prior: -second.ln(),
            fine_print: Thresholds::FINE_PRINT * top.max(0.0),
        }
    }

    /// The price of so many effects together.
    pub fn of(self, count: usize) -> f64 {
        (self.fine_print + self.prior) * (count - 1) as f64
    }
}
