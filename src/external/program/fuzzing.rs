//! Entries for the fuzz tests that otherwise only a running program reaches. No part of the library's interface.

use super::description::Description;
use super::{frame, protocol};
use crate::record::{Drive, Signals};
use crate::study::Study;

/// Reads a line as a program's description, up to the study of one that is a text.
pub fn description(line: &str) -> Result<(), String> {
    match Description::parse(line)?.inside {
        Some(inside) => Study::of_file(&inside.file)
            .map(|_| ())
            .map_err(|error| error.to_string()),
        None => Ok(()),
    }
}

/// Reads a line as the answer to request 1: for three samples of one output `y`, or for two rows of numbers at three points.
pub fn answer(line: &str) -> Result<(), String> {
    if frame::reply(line, 1, (2, 3)).is_ok() {
        return Ok(());
    }
    let drive = Drive::autonomous(0.5, 3).map_err(|error| error.to_string())?;
    protocol::answer(line, 1, &Signals::default(), &drive).map(|_| ())
}
