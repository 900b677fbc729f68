//! Standard output and error; a call within a test keeps what would go there.

use crate::storage::untrusted::printable;
use std::io::{self, Write};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Texts that a call within a test has written.
#[derive(Debug, Default)]
pub(super) struct Written {
    /// Text on standard output.
    pub printed: String,
    /// Text on standard error.
    pub said: String,
}

/// Texts of the call within a test; none where there is no such call.
static KEPT: Mutex<Option<Written>> = Mutex::new(None);

fn kept() -> MutexGuard<'static, Option<Written>> {
    KEPT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Keeps what is written from here on.
pub(super) fn keep() {
    *kept() = Some(Written::default());
}

/// Returns what was written since [`keep`], and ends it.
pub(super) fn taken() -> Written {
    kept().take().unwrap_or_default()
}

/// Prints a text to standard output.
pub(super) fn print(text: &str) -> io::Result<()> {
    if let Some(written) = &mut *kept() {
        written.printed += text;
        return Ok(());
    }
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush())
}

/// Prints a message to standard error; a closed pipe is ignored.
pub(super) fn say(text: &str) {
    let text = printable(text);
    if let Some(written) = &mut *kept() {
        written.said += &format!("{text}\n");
        return;
    }
    let _ = writeln!(io::stderr().lock(), "{text}");
}
