//! Calls of the program in a folder of their own.

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

pub const TRUETWIN: &str = env!("CARGO_BIN_EXE_truetwin");

/// Runs a call to its end.
pub fn run(folder: &Path, words: &str) -> Output {
    let mut command = Command::new(TRUETWIN);
    command.args(words.split_whitespace()).current_dir(folder);
    command.output().unwrap()
}

/// Starts a call whose standard error can be read.
pub fn start(folder: &Path, words: &str) -> Child {
    let mut command = Command::new(TRUETWIN);
    command.args(words.split_whitespace()).current_dir(folder);
    (command.stdout(Stdio::null()).stderr(Stdio::piped()))
        .spawn()
        .unwrap()
}

/// Sends a signal, such as `-INT`, to a call.
pub fn signal(child: &Child, name: &str) {
    let id = child.id().to_string();
    let sent = Command::new("kill").args([name, &id]).status();
    assert!(sent.unwrap().success());
}

/// Text on standard error.
pub fn told(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}
