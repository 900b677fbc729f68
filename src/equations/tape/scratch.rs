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
    static KEPT_NUMBERS: RefCell<Vec<(Kind, Box<Numbers>)>> = const { RefCell::new(Vec::new()) };
}

/// Returns the number of a new tape.
pub(super) fn new_id() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// Tape, and numbers of a group.
pub(super) type Kind = (u64, usize);

/// Takes the numbers of a tape as its last call on this thread left them, if it kept them.
#[inline]
pub(super) fn take_numbers(kind: Kind) -> Option<Box<Numbers>> {
    KEPT_NUMBERS.with_borrow_mut(|kept| {
        let at = kept.iter().rposition(|(other, _)| *other == kind)?;
        Some(kept.swap_remove(at).1)
    })
}

/// Keeps the numbers of a tape for its next call on this thread.
#[inline]
pub(super) fn keep_numbers(kind: Kind, numbers: Box<Numbers>) {
    KEPT_NUMBERS.with_borrow_mut(|kept| {
        // Any may go: what is at work is soon made again.
        if kept.len() >= KEPT {
            kept.swap_remove(0);
        }
        kept.push((kind, numbers));
    });
}
