//! Count of the passes over records that a piece of work takes: what it costs, whatever the machine.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Passes over a record, of a filter or of an ensemble of simulations, with or without derivatives. Clones share the count.
#[derive(Clone, Default)]
pub(crate) struct Passes(Arc<AtomicU64>);

impl Passes {
    pub fn count(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }

    pub fn so_far(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}
