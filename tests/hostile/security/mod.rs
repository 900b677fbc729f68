//! Files are data: they run nothing, lead nowhere, and steer no terminal (docs/reliability.md).

mod folders;
mod programs;

use std::path::Path;
use std::process::{Command, Output};

fn truetwin(place: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_truetwin"));
    command.args(arguments).current_dir(place).output().unwrap()
}

fn done(place: &Path, arguments: &[&str]) -> String {
    let output = truetwin(place, arguments);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {message}");
    String::from_utf8(output.stdout).unwrap()
}

/// Exit 2 and one line without anything that steers a terminal; returns it.
fn refused(place: &Path, arguments: &[&str]) -> String {
    let output = truetwin(place, arguments);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
    let line = message.trim_end_matches('\n');
    assert!(!line.contains(char::is_control), "{line:?}");
    line.to_owned()
}
