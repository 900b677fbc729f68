//! Entries for the fuzz tests that otherwise only a running program reaches. No part of the library's interface.

use super::description::Description;
use super::protocol;
use crate::record::{Drive, Signals};

/// Reads a line as a program's description.
pub fn description(line: &str) -> Result<(), String> {
    Description::parse(line).map(|_| ())
}

/// Reads a line as the answer to request 1 for three samples of one output `y`.
pub fn answer(line: &str) -> Result<(), String> {
    let drive = Drive::autonomous(0.5, 3).map_err(|error| error.to_string())?;
    protocol::answer(line, 1, &Signals::default(), &drive).map(|_| ())
}
