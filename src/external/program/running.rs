//! The programs that this process has started and not yet ended.

use std::io;
use std::process::{Child, Command, ExitStatus};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

static ALL: Mutex<Vec<Weak<Mutex<Child>>>> = Mutex::new(Vec::new());

/// Locks what stays whole whoever panics beside it.
pub(super) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Ends all programs at once: their process ends without unwinding.
pub(crate) fn end_all() {
    for child in locked(&ALL).iter().filter_map(Weak::upgrade) {
        // One that is gone already says so.
        let _ = locked(&child).kill();
    }
}

/// A program that runs.
pub(super) struct Running(Arc<Mutex<Child>>);

impl Running {
    /// Starts a program.
    pub fn start(command: &mut Command) -> io::Result<Self> {
        // Held until the program is listed: none is missed that begins while all are ended.
        let mut all = locked(&ALL);
        let child = Arc::new(Mutex::new(command.spawn()?));
        all.retain(|other| other.strong_count() > 0);
        all.push(Arc::downgrade(&child));
        Ok(Self(child))
    }

    /// Looks at the process.
    pub fn with<T>(&self, look: impl FnOnce(&mut Child) -> T) -> T {
        look(&mut locked(&self.0))
    }

    /// Returns how it ended, if it did.
    pub fn ended(&self) -> io::Result<Option<ExitStatus>> {
        self.with(Child::try_wait)
    }

    /// Ends it and waits for that.
    pub fn end(&self) {
        // Of a process that is gone already, both say so.
        self.with(|child| drop((child.kill(), child.wait())));
    }
}
