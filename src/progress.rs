//! One handle for progress and cancellation, silent by default.
//!
//! Long work takes a [`Progress`] and shows its stages to it. Whoever embeds the crate listens by implementing
//! [`Listener`]; the library itself never prints.
//!
//! ```
//! use std::sync::Arc;
//! use std::sync::atomic::{AtomicBool, Ordering};
//! use truetwin::progress::{Cancelled, Listener, Progress};
//!
//! #[derive(Default)]
//! struct Button(AtomicBool);
//! impl Listener for Button {
//!     fn advanced(&self, stage: &str, done: u64, total: u64) {
//!         println!("{stage}: {done} of {total}");
//!     }
//!     fn cancelled(&self) -> bool {
//!         self.0.load(Ordering::Relaxed)
//!     }
//! }
//!
//! let button = Arc::new(Button::default());
//! let progress = Progress::new(button.clone()); // for `pretrain`, `estimate`, `diagnose` …
//! assert_eq!(progress.checkpoint(), Ok(()));
//! button.0.store(true, Ordering::Relaxed);
//! assert_eq!(progress.checkpoint(), Err(Cancelled));
//! ```

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// `true` where the process was asked to stop, and its work ends with what was found.
static HASTE: AtomicBool = AtomicBool::new(false);
/// `true` while what was found is put together.
static ENDING: AtomicBool = AtomicBool::new(false);

/// Has black boxes give up their simulations until what was found is put together: a pass over a record may take many.
pub(crate) fn hasten() {
    HASTE.store(true, Ordering::Relaxed);
}

/// Says whether what was found is put together.
pub(crate) fn put_together(ending: bool) {
    ENDING.store(ending, Ordering::Relaxed);
}

/// Returns whether simulations of black boxes are given up.
pub(crate) fn is_hastened() -> bool {
    HASTE.load(Ordering::Relaxed) && !ENDING.load(Ordering::Relaxed)
}

/// Receiver of progress, implemented by an application; it can also stop long work.
///
/// Methods are called from worker threads, often: keep them short.
pub trait Listener: Send + Sync {
    /// `stage` has `done` of `total` units behind it. The first call of a stage has `done` = 0.
    fn advanced(&self, stage: &str, done: u64, total: u64);

    /// Asked at each unit of work; `true` ends the work with [`Cancelled`].
    fn cancelled(&self) -> bool {
        false
    }
}

/// The work was stopped by [`Listener::cancelled`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

/// A cheap, cloneable handle that long work reports to.
#[derive(Clone, Default)]
pub struct Progress(Option<Arc<dyn Listener>>);

impl Progress {
    /// Reports to `listener`.
    pub fn new(listener: Arc<dyn Listener>) -> Self {
        Self(Some(listener))
    }

    /// Reports to nobody and is never cancelled.
    pub fn silent() -> Self {
        Self(None)
    }

    /// Opens a stage of `total` units.
    pub(crate) fn stage(&self, name: &'static str, total: usize) -> Stage {
        if let Some(listener) = &self.0 {
            listener.advanced(name, 0, total as u64);
        }
        Stage {
            progress: self.clone(),
            name,
            done: AtomicU64::new(0),
            total: total as u64,
        }
    }

    /// For parts of a piece of work that is itself one unit: shows nothing, but ends when the listener asks to stop.
    pub(crate) fn unshown(&self) -> Self {
        Self::new(Arc::new(Unshown(self.clone())))
    }

    /// Fails where the listener asks to stop.
    pub fn checkpoint(&self) -> Result<(), Cancelled> {
        match &self.0 {
            Some(listener) if listener.cancelled() => Err(Cancelled),
            _ => Ok(()),
        }
    }
}

impl fmt::Debug for Progress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.0.is_some() {
            "Progress(listening)"
        } else {
            "Progress(silent)"
        })
    }
}

/// A listener that only stops the work.
struct Unshown(Progress);

impl Listener for Unshown {
    fn advanced(&self, _: &str, _: u64, _: u64) {}
    fn cancelled(&self) -> bool {
        self.0.checkpoint().is_err()
    }
}

/// One part of long work; shared by threads.
#[derive(Debug)]
pub(crate) struct Stage {
    progress: Progress,
    name: &'static str,
    done: AtomicU64,
    total: u64,
}

impl Stage {
    /// One unit is done. Fails where the listener asks to stop.
    pub fn tick(&self) -> Result<(), Cancelled> {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        if let Some(listener) = &self.progress.0 {
            listener.advanced(self.name, done, self.total);
        }
        self.progress.checkpoint()
    }

    /// Fails where the listener asks to stop.
    pub fn checkpoint(&self) -> Result<(), Cancelled> {
        self.progress.checkpoint()
    }

    /// So many units were done before, by work that this goes on with.
    pub fn skip(&self, done: usize) {
        let done = self.done.fetch_add(done as u64, Ordering::Relaxed) + done as u64;
        if let Some(listener) = &self.progress.0
            && done > 0
        {
            listener.advanced(self.name, done, self.total);
        }
    }

    /// The stage ended before its last unit (early stop): report it complete.
    pub fn finish(&self) {
        if let Some(listener) = &self.progress.0 {
            listener.advanced(self.name, self.total, self.total);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct StopAfter(u64, AtomicU64);
    impl Listener for StopAfter {
        fn advanced(&self, _: &str, done: u64, _: u64) {
            self.1.store(done, Ordering::Relaxed);
        }
        fn cancelled(&self) -> bool {
            self.1.load(Ordering::Relaxed) >= self.0
        }
    }

    #[test]
    fn a_listener_stops_the_work() {
        let progress = Progress::new(Arc::new(StopAfter(3, AtomicU64::new(0))));
        let stage = progress.stage("work", 10);
        let done = (0..10).take_while(|_| stage.tick().is_ok()).count();
        assert_eq!(done, 2, "the third tick is refused");
    }

    #[test]
    fn what_is_not_shown_is_still_stopped() {
        let progress = Progress::new(Arc::new(StopAfter(2, AtomicU64::new(0))));
        let inner = progress.unshown();
        let stage = inner.stage("inner", 3);
        assert!((0..3).all(|_| stage.tick().is_ok()), "nothing was counted");
        let outer = progress.stage("outer", 2);
        assert!(outer.tick().is_ok() && outer.tick().is_err());
        assert!(inner.checkpoint().is_err());
    }

    #[test]
    fn silence_is_never_cancelled() {
        let stage = Progress::silent().stage("work", 1);
        assert_eq!(stage.tick(), Ok(()));
    }
}
