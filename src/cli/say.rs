//! Messages on standard error.

use crate::storage::untrusted::printable;
use std::io::{self, Write};

/// Prints a message to standard error; a closed pipe is ignored.
pub(super) fn say(text: &str) {
    let _ = writeln!(io::stderr().lock(), "{}", printable(text));
}
