//! Pieces of work on all cores, each with cores of its own.

use rayon::{ThreadPoolBuildError, ThreadPoolBuilder};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Does `work` on every item, in parallel; the results are in no order.
///
/// The current pool's threads are shared out to workers, each a pool of its own: work that is itself parallel neither
/// waits for nor takes up another item, so that its wall-clock time is its own. The first error stops the others at
/// their next item.
pub(crate) fn share_out<T: Send, E: Send + From<ThreadPoolBuildError>>(
    items: &[usize],
    work: impl Fn(usize) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E> {
    let threads = rayon::current_num_threads();
    let workers = threads.min(items.len());
    let next = AtomicUsize::new(0);
    let worker = |number: usize| {
        let share = threads / workers + usize::from(number < threads % workers);
        let pool = ThreadPoolBuilder::new().num_threads(share).build()?;
        pool.install(|| {
            let mut done = Vec::new();
            while let Some(&item) = items.get(next.fetch_add(1, Ordering::Relaxed)) {
                match work(item) {
                    Ok(result) => done.push(result),
                    Err(error) => {
                        next.store(items.len(), Ordering::Relaxed);
                        return Err(error);
                    }
                }
            }
            Ok(done)
        })
    };
    let worker = &worker;
    std::thread::scope(|scope| {
        let crew: Vec<_> = (0..workers)
            .map(|number| scope.spawn(move || worker(number)))
            .collect();
        let mut all = Vec::with_capacity(items.len());
        for member in crew {
            match member.join() {
                Ok(done) => all.extend(done?),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        Ok(all)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Cancelled;

    #[derive(Debug, thiserror::Error)]
    enum Stop {
        #[error(transparent)]
        Threads(#[from] ThreadPoolBuildError),
        #[error(transparent)]
        Cancelled(#[from] Cancelled),
    }

    #[test]
    fn every_item_is_done_once_whatever_the_threads() {
        for threads in [1, 3, 16] {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build();
            let mut done = pool.unwrap().install(|| {
                share_out(&[4, 5, 6, 7, 8], |i| {
                    Ok::<_, Stop>((i, rayon::current_num_threads()))
                })
                .unwrap()
            });
            done.sort_unstable();
            let items: Vec<usize> = done.iter().map(|d| d.0).collect();
            assert_eq!(items, [4, 5, 6, 7, 8]);
            let most = threads.div_ceil(threads.min(5));
            assert!(done.iter().all(|d| (1..=most).contains(&d.1)), "{done:?}");
        }
        assert!(share_out(&[], Ok::<_, Stop>).unwrap().is_empty());
    }

    #[test]
    fn an_error_ends_the_work() {
        let begun = AtomicUsize::new(0);
        let items: Vec<usize> = (0..1000).collect();
        let result = share_out(&items, |_| -> Result<(), Stop> {
            begun.fetch_add(1, Ordering::Relaxed);
            Err(Cancelled.into())
        });
        assert!(matches!(result, Err(Stop::Cancelled(_))));
        assert!(begun.into_inner() <= rayon::current_num_threads());
    }
}
