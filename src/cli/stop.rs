//! Ctrl-C stops the work at its next step and prints how to resume; a second one ends the process at once.

use super::context::Verb;
use super::failure::{Failure, STOPPED};
use super::remedy::Cause;
use std::ffi::OsString;
use std::sync::atomic::{AtomicBool, Ordering};

static ASKED: AtomicBool = AtomicBool::new(false);

/// Installs the handler of Ctrl-C.
pub(super) fn listen() {
    let asked = || {
        if ASKED.swap(true, Ordering::Relaxed) {
            std::process::exit(STOPPED.into());
        }
    };
    // An application around this command line keeps its own handler.
    let _ = ctrlc::set_handler(asked);
}

/// Makes a write beyond the limit of file sizes (`ulimit -f`) an error instead of the end of the process.
#[cfg(unix)]
pub(super) fn report_file_size_limit() {
    extern "C" fn nothing(_: libc::c_int) {}
    let handler = nothing as extern "C" fn(libc::c_int) as libc::sighandler_t;
    // SAFETY: the handler does nothing, which is allowed at any point of the program. Unlike an ignored signal, a handled one
    // is not inherited by the programs that this process starts.
    unsafe { libc::signal(libc::SIGXFSZ, handler) };
}

#[cfg(not(unix))]
pub(super) fn report_file_size_limit() {}

/// Tells whether the work is to stop.
pub(super) fn asked() -> bool {
    ASKED.load(Ordering::Relaxed)
}

/// Creates the failure of a stopped call; `call` holds its words.
pub(super) fn failure(verb: &dyn Verb, call: &[OsString]) -> Failure {
    let words: Vec<_> = call.iter().map(|word| word.to_string_lossy()).collect();
    let text = match verb.is_resumed() {
        true => {
            "stopped; finished work is kept; resume with: ".to_owned() + &shell_words::join(&words)
        }
        false => "stopped; nothing was written".into(),
    };
    Failure::new(text, Cause::Stop)
}
