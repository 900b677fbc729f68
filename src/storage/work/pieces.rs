//! Numbered pieces of work, kept in a folder and divided among threads.

use super::{Share, WorkFolder};
use crate::progress::{Cancelled, Stage};
use crate::storage::StorageError;
use rayon::ThreadPoolBuilder;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Result of a piece of work.
pub(crate) trait Piece: Serialize + DeserializeOwned + Send {
    /// Its number, from 0.
    fn number(&self) -> usize;
}

/// Pieces 0 … `count` − 1 of a part.
pub(crate) struct Pieces<'a> {
    /// Folder that keeps them.
    pub folder: Option<&'a WorkFolder>,
    /// Part of the folder.
    pub part: &'static str,
    /// Number of pieces.
    pub count: usize,
    /// Pieces to be made by this process.
    pub share: Share,
}

impl Pieces<'_> {
    /// Returns the kept pieces, in order.
    pub fn kept<T: Piece>(
        &self,
        fits: impl Fn(&T) -> Result<(), &'static str>,
    ) -> Result<Vec<T>, StorageError> {
        let Some(folder) = self.folder else {
            return Ok(vec![]);
        };
        (0..self.count)
            .filter_map(|number| {
                let fits = |piece: &T| match piece.number() {
                    same if same == number => fits(piece),
                    _ => Err("it holds another number"),
                };
                folder.kept(self.part, number, fits).transpose()
            })
            .collect()
    }

    /// Makes and keeps the missing pieces of the share, in parallel, each on its part of the current threads; returns all kept
    /// pieces, in order. One tick for each.
    pub fn all<T: Piece, E>(
        &self,
        stage: &Stage,
        fits: impl Fn(&T) -> Result<(), &'static str>,
        make: impl Fn(usize) -> Result<T, E> + Sync,
    ) -> Result<Vec<T>, E>
    where
        E: From<StorageError> + From<Cancelled> + Send,
    {
        let mut all = self.kept(fits)?;
        for _ in &all {
            stage.tick()?;
        }
        let known: std::collections::HashSet<usize> = all.iter().map(Piece::number).collect();
        let missing: Vec<usize> = (0..self.count)
            .filter(|number| self.share.takes(*number) && !known.contains(number))
            .collect();
        all.extend(thread_groups(&missing, |number| {
            let made = make(number)?;
            if let Some(folder) = self.folder {
                folder.keep(self.part, number, &made)?;
            }
            stage.tick()?;
            Ok::<T, E>(made)
        })?);
        all.sort_by_key(Piece::number);
        if let Some(folder) = self.folder
            && all.len() == self.count
        {
            folder.sweep();
        }
        Ok(all)
    }
}

/// Does `work` on every item, in parallel; the results are in no order.
///
/// The current pool's threads are divided into groups, each a pool of its own. Work that is itself parallel therefore neither waits for
/// another item nor runs one, so that its wall-clock time is its own. The first error stops the other groups at their next item.
fn thread_groups<T: Send, E: Send + From<StorageError>>(
    items: &[usize],
    work: impl Fn(usize) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E> {
    let threads = rayon::current_num_threads();
    let groups = threads.min(items.len());
    let next = AtomicUsize::new(0);
    let group = |number: usize| {
        let size = threads / groups + usize::from(number < threads % groups);
        let pool = (ThreadPoolBuilder::new().num_threads(size).build())
            .map_err(|error| StorageError::threads(threads, error))?;
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
    let group = &group;
    std::thread::scope(|scope| {
        let running = (0..groups).map(|number| {
            let thread = std::thread::Builder::new().spawn_scoped(scope, move || group(number));
            thread.map_err(|error| {
                next.store(items.len(), Ordering::Relaxed);
                StorageError::threads(threads, error)
            })
        });
        let running: Vec<_> = running.collect::<Result<_, _>>()?;
        let mut all = Vec::with_capacity(items.len());
        for thread in running {
            match thread.join() {
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
        Storage(#[from] StorageError),
        #[error(transparent)]
        Cancelled(#[from] Cancelled),
    }

    #[test]
    fn every_item_is_done_once_whatever_the_threads() {
        for threads in [1, 3, 16] {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build();
            let mut done = pool.unwrap().install(|| {
                thread_groups(&[4, 5, 6, 7, 8], |i| {
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
        assert!(thread_groups(&[], Ok::<_, Stop>).unwrap().is_empty());
    }

    #[test]
    fn an_error_ends_the_work() {
        let begun = AtomicUsize::new(0);
        let items: Vec<usize> = (0..1000).collect();
        let result = thread_groups(&items, |_| -> Result<(), Stop> {
            begun.fetch_add(1, Ordering::Relaxed);
            Err(Cancelled.into())
        });
        assert!(matches!(result, Err(Stop::Cancelled(_))));
        assert!(begun.into_inner() <= rayon::current_num_threads());
    }
}
