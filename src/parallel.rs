//! Work on all cores of the current pool, with results in the order of its items: one loop for all types, since each parallel iterator is compiled anew.

use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// `work` on each item.
pub(crate) fn each<I: Send, R: Send>(
    items: impl IntoIterator<Item = I>,
    work: impl Fn(I) -> R + Sync,
) -> Vec<R> {
    let slots: Vec<Mutex<WorkSlot<I, R>>> = (items.into_iter())
        .map(|item| Mutex::new(WorkSlot::Waiting(item)))
        .collect();
    spread(slots.len(), &|i| {
        let waiting = std::mem::replace(&mut *locked(&slots[i]), WorkSlot::Begun);
        if let WorkSlot::Waiting(item) = waiting {
            let done = work(item);
            *locked(&slots[i]) = WorkSlot::Done(done);
        }
    });
    (slots.into_iter())
        .map(|slot| slot.into_inner().unwrap_or_else(PoisonError::into_inner))
        .filter_map(|slot| match slot {
            WorkSlot::Done(result) => Some(result),
            _ => None,
        })
        .collect()
}

/// `work` that may fail on each item.
///
/// # Errors
///
/// That of the first item that fails; of the later ones, those that no thread has begun by then are left.
pub(crate) fn try_each<I: Send, T: Send, E: Send>(
    items: impl IntoIterator<Item = I>,
    work: impl Fn(I) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E> {
    let failed = AtomicUsize::new(usize::MAX);
    let all = each(items.into_iter().enumerate(), |(i, item)| {
        if i > failed.load(Ordering::Relaxed) {
            return None;
        }
        let result = work(item);
        if result.is_err() {
            failed.fetch_min(i, Ordering::Relaxed);
        }
        Some(result)
    });
    all.into_iter().flatten().collect()
}

/// `work` that may fail or find nothing on each item; returns what is found.
///
/// # Errors
///
/// As those of [`try_each`].
pub(crate) fn try_found<I: Send, T: Send, E: Send>(
    items: impl IntoIterator<Item = I>,
    work: impl Fn(I) -> Result<Option<T>, E> + Sync,
) -> Result<Vec<T>, E> {
    Ok(try_each(items, work)?.into_iter().flatten().collect())
}

enum WorkSlot<I, R> {
    Waiting(I),
    Begun,
    Done(R),
}

fn locked<T>(slot: &Mutex<T>) -> MutexGuard<'_, T> {
    slot.lock().unwrap_or_else(PoisonError::into_inner)
}

fn spread(count: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(work);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_stand_in_the_order_of_their_items() {
        let words: Vec<String> = each(0..300, |i| format!("{i}"));
        let expected: Vec<String> = (0..300).map(|i| i.to_string()).collect();
        assert_eq!(words, expected);
        assert!(each(Vec::<u8>::new(), |v| v).is_empty());
    }

    /// The error does not depend on which thread is first.
    #[test]
    fn the_first_error_is_told() {
        for _ in 0..200 {
            let found = try_each(0..100, |i| if i % 37 == 17 { Err(i) } else { Ok(i) });
            assert_eq!(found, Err(17));
        }
        assert_eq!(try_each(0..3, Ok::<_, ()>), Ok(vec![0, 1, 2]));
    }

    #[test]
    fn work_within_work_ends() {
        let sums = each(0..20u64, |i| each(0..50, |j| i * j).iter().sum::<u64>());
        assert_eq!(sums[19], 19 * 49 * 25);
    }
}
