//! Passes that wait, each on a thread of its own.

use crate::twin::{Composed, Twin};

impl Twin {
    /// Runs `work` with as many threads as passes of this twin should be under way at once: where each call of the equations waits for an
    /// exchange that passes share, threads that wait take no core. With fewer threads at hand the numbers are the same.
    pub(crate) fn side_by_side<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        let passes = self.equations().map_or(1, Composed::beside);
        if passes <= rayon::current_num_threads() {
            return work();
        }
        match rayon::ThreadPoolBuilder::new().num_threads(passes).build() {
            Ok(pool) => pool.install(work),
            Err(_) => work(),
        }
    }
}
