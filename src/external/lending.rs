//! Things that are slow to make and serve one thread at a time.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// At most so many things at once: idle ones are lent before new ones are made.
pub(super) struct Lending<T> {
    most: usize,
    state: Mutex<Stock<T>>,
    free: Condvar,
}

struct Stock<T> {
    idle: Vec<T>,
    /// Lent out or being made.
    lent: usize,
}

/// The right to use one thing; given back when dropped.
pub(super) struct Place<'a, T>(&'a Lending<T>);

impl<T> Drop for Place<'_, T> {
    fn drop(&mut self) {
        self.0.lock().lent -= 1;
        self.0.free.notify_one();
    }
}

impl<T> Place<'_, T> {
    /// Keeps a thing for the next one who asks.
    pub fn give_back(self, thing: T) {
        self.0.lock().idle.push(thing);
    }
}

impl<T> Lending<T> {
    /// At most `most` things.
    pub fn new(most: usize) -> Self {
        Self {
            most,
            state: Mutex::new(Stock {
                idle: Vec::new(),
                lent: 0,
            }),
            free: Condvar::new(),
        }
    }

    /// Number of things, at most.
    pub fn most(&self) -> usize {
        self.most
    }

    /// Waits until there is room. An idle thing that is `usable`, else `None`: make one. Asked for a `fresh` one, it is always
    /// to be made, and an idle one makes room where there is none.
    pub fn take(
        &self,
        fresh: bool,
        mut usable: impl FnMut(&mut T) -> bool,
    ) -> (Option<T>, Place<'_, T>) {
        let mut state = self.lock();
        while state.lent >= self.most {
            let woken = self.free.wait(state);
            state = woken.unwrap_or_else(PoisonError::into_inner);
        }
        state.lent += 1;
        let place = Place(self);
        if fresh {
            let surplus = (state.lent + state.idle.len() > self.most).then(|| state.idle.pop());
            // What it takes to end a thing, others need not wait for.
            drop(state);
            drop(surplus);
            return (None, place);
        }
        while let Some(mut thing) = state.idle.pop() {
            if usable(&mut thing) {
                return (Some(thing), place);
            }
        }
        (None, place)
    }

    /// Takes in a thing that was made elsewhere.
    pub fn adopt(&self, thing: T) {
        self.lock().idle.push(thing);
    }

    /// The idle things, when none is lent any more.
    pub fn idle(&mut self) -> &mut Vec<T> {
        let state = self.state.get_mut();
        &mut state.unwrap_or_else(PoisonError::into_inner).idle
    }

    fn lock(&self) -> MutexGuard<'_, Stock<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn never_more_than_allowed_and_idle_ones_first() {
        let lending = Lending::new(2);
        let (made, busy, most) = (
            AtomicUsize::new(0),
            AtomicUsize::new(0),
            AtomicUsize::new(0),
        );
        (0..200).into_par_iter().for_each(|i| {
            let (idle, place) = lending.take(i % 10 == 0, |_| true);
            let thing = idle.unwrap_or_else(|| made.fetch_add(1, Ordering::SeqCst));
            most.fetch_max(busy.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
            std::thread::yield_now();
            busy.fetch_sub(1, Ordering::SeqCst);
            place.give_back(thing);
        });
        assert!(most.into_inner() <= 2);
        assert!(
            (20..=22).contains(&made.into_inner()),
            "20 fresh ones, 2 at first"
        );
    }

    #[test]
    fn what_is_not_usable_is_dropped() {
        let mut lending = Lending::new(3);
        [1, 2, 3].into_iter().for_each(|i| lending.adopt(i));
        let (taken, place) = lending.take(false, |i| *i == 2);
        assert_eq!(taken, Some(2));
        drop(place);
        assert_eq!(*lending.idle(), [1]);
    }
}
