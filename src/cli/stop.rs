//! Ctrl-C and SIGTERM: the work stops at its next step, or is left after a moment; a second one ends the process at once.

use super::context::Verb;
use super::failure::{Failure, STOPPED, say};
use super::remedy::Cause;
use super::shell_word;
use crate::external::program::end_all;
use crate::progress::{hasten, is_hastened};
use crate::storage::work::has_pieces;
use crate::storage::{remove_unfinished, result};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

static ASKED: AtomicBool = AtomicBool::new(false);
static STOP: OnceLock<StoppedCall> = OnceLock::new();
/// `true` where work that is stopped ends with what was found so far, which may take longer than a moment.
static ENDS: AtomicBool = AtomicBool::new(false);

/// Time that work has to come to its next step, or to write what it found. The documented limit is 2 s; half of it cuts more training
/// steps off before they are kept.
const MOMENT: Duration = Duration::from_millis(1500);

/// The end of a call that is stopped.
struct StoppedCall {
    /// The call, as a shell reads it.
    call: String,
    /// Folder of finished work that the same call resumes.
    kept: Option<PathBuf>,
}

impl StoppedCall {
    fn text(&self) -> String {
        let resume = &self.call;
        // What is finished inside the folder of the work is a piece of it.
        let is_piece = |result: &&Path| self.kept.iter().any(|kept| result.starts_with(kept));
        if let Some(result) = result().filter(|result| !is_piece(result)) {
            return format!("stopped; {} is complete", shell_word::shown(result));
        }
        match &self.kept {
            Some(folder) if has_pieces(folder) => {
                let folder = shell_word::shown(folder);
                format!("stopped; finished work is kept in {folder}; resume with: {resume}")
            }
            Some(folder) if folder.exists() => {
                format!(
                    "stopped; no piece of the work was finished yet; begin again with: {resume}"
                )
            }
            _ => "stopped; nothing was written".into(),
        }
    }
}

/// Installs the handler of Ctrl-C for a call of a verb.
pub(super) fn listen(verb: &dyn Verb, call: &[OsString]) {
    let _ = STOP.set(StoppedCall {
        call: shell_word::line(call.iter().map(OsString::as_os_str)),
        kept: verb.kept(),
    });
    let asked = || {
        if ASKED.swap(true, Ordering::Relaxed) {
            end();
        }
        if ENDS.load(Ordering::Relaxed) {
            hasten();
        }
        let _ = thread::Builder::new().spawn(leave);
    };
    // An application around this command line keeps its own handler.
    let _ = ctrlc::set_handler(asked);
}

/// Lets the work of this call come to its end from here on: it stops by itself, with what it has found.
pub(super) fn let_end() {
    ENDS.store(true, Ordering::Relaxed);
}

/// Ends a process whose work does not come to its next step.
fn leave() {
    thread::sleep(MOMENT);
    let Some(stop) = STOP.get() else { return };
    if ENDS.load(Ordering::Relaxed) {
        if is_hastened() {
            end_all();
        }
        say("stopping at the next step of the search; Ctrl-C again ends at once");
        return;
    }
    say(&format!("error: {}", stop.text()));
    end();
}

/// Ends the process with nothing of it left behind: neither programs nor unfinished folders.
fn end() -> ! {
    end_all();
    remove_unfinished();
    std::process::exit(STOPPED.into())
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

/// Creates the failure of the stopped call.
pub(super) fn failure() -> Failure {
    let text = STOP.get().map_or("stopped".into(), StoppedCall::text);
    Failure::new(text, Cause::Stop)
}
