//! Numbers of tapes between calls, one set for each thread.

use super::groups::PlacedOperation;
use std::cell::RefCell;
use std::sync::atomic::{AtomicU64, Ordering};

/// Sets that a thread keeps: a twin has some five, and few twins are at work at a time.
const KEPT: usize = 40;

/// Numbers of one tape, in groups of one size, and its operations on them: by θ, by the step, by states.
pub(super) struct Numbers {
    pub values: Vec<f64>,
    pub operations: [Vec<PlacedOperation>; 3],
}

thread_local! {
    static KEPT_NUMBERS: RefCell<Vec<((u64, usize), Numbers)>> = const { RefCell::new(Vec::new()) };
}

/// Returns the number of a new tape.
pub(super) fn new_id() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// Calls `work` with the numbers of a tape, as its last call on this thread left them; those of the first are made by `begin`.
#[inline(always)]
pub(super) fn with_numbers(
    of: (u64, usize),
    begin: impl FnOnce() -> Numbers,
    work: impl FnOnce(&mut Numbers),
) {
    KEPT_NUMBERS.with_borrow_mut(|kept| {
        let at = match kept.iter().position(|(other, _)| *other == of) {
            Some(at) => at,
            None => {
                // The oldest goes: what is at work is soon made again.
                if kept.len() >= KEPT {
                    kept.remove(0);
                }
                kept.push((of, begin()));
                kept.len() - 1
            }
        };
        work(&mut kept[at].1);
    });
}
