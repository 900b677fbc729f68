//! Ctrl-C: the work ends at its next step, and says how to go on; a second one ends the process at once.

use super::{Failure, Verb};
use std::ffi::OsString;
use std::sync::atomic::{AtomicBool, Ordering};

/// What a shell reports of a process that Ctrl-C has ended.
pub(super) const CODE: u8 = 130;

static ASKED: AtomicBool = AtomicBool::new(false);

/// From now on, Ctrl-C asks the work to stop.
pub(super) fn listen() {
    let asked = || {
        if ASKED.swap(true, Ordering::Relaxed) {
            std::process::exit(CODE.into());
        }
    };
    // An application around this command line may have a handler of its own; that one stays.
    let _ = ctrlc::set_handler(asked);
}

/// Whether the work is to stop.
pub(super) fn asked() -> bool {
    ASKED.load(Ordering::Relaxed)
}

/// What is said of a call that was stopped; `call` is its words.
pub(super) fn failure(verb: &dyn Verb, call: &[OsString]) -> Failure {
    let words: Vec<_> = call.iter().map(|word| word.to_string_lossy()).collect();
    let text = match verb.is_resumed() {
        true => format!(
            "stopped; what is finished is kept, and this goes on: {}",
            shell_words::join(&words)
        ),
        false => "stopped; nothing was written".into(),
    };
    Failure::stopped(text, CODE)
}
