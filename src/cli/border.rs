//! The border of the program: a fault in it is one line and exit code 1, and costs no answer that was found before.

use super::failure::Failure;
use crate::storage::StorageError;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::{Mutex, PoisonError};
use std::thread;

/// Place of the first fault, file and line.
static PLACE: Mutex<Option<String>> = Mutex::new(None);

/// Notes where a fault is, in place of a trace of it on standard error.
pub(super) fn keep_quiet() {
    set_hook(Box::new(|fault| {
        let mut place = PLACE.lock().unwrap_or_else(PoisonError::into_inner);
        if let (None, Some(at)) = (&*place, fault.location()) {
            *place = Some(format!("{}:{}", at.file(), at.line()));
        }
    }));
}

/// Stack of the program, in bytes: what systems give a process by default.
const STACK: usize = 8 << 20;

/// Works on a stack of a known size, however small that of the process is (`ulimit -s`).
pub(super) fn on_own_stack<T: Send>(work: impl FnOnce() -> T + Send) -> Result<T, Failure> {
    thread::scope(|scope| {
        let builder = thread::Builder::new().stack_size(STACK);
        let started = builder.spawn_scoped(scope, work);
        let started = started.map_err(|error| StorageError::threads(1, &error))?;
        started.join().map_err(|fault| failure(&*fault))
    })
}

/// Does work; a fault in it is a failure.
pub(super) fn guarded<T>(work: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    // Nothing of the work is looked at after a fault.
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|fault| Err(failure(&*fault)))
}

/// Writes the files of a result and prints it. Where they cannot be written it is printed, and kept elsewhere; the code of the failure is
/// the call's.
pub(super) fn deliver(
    write: impl FnOnce() -> Result<(), Failure>,
    keep: impl FnOnce() -> Option<PathBuf>,
    print: impl FnOnce() -> Result<ExitCode, Failure>,
) -> Result<ExitCode, Failure> {
    let written = guarded(write).map_err(|failure| match keep() {
        Some(place) => failure.and(&format!("the answer is in {}", place.display())),
        None => failure,
    });
    let printed = guarded(print);
    written.and(printed)
}

fn failure(fault: &(dyn Any + Send)) -> Failure {
    let text = (fault.downcast_ref::<&str>().copied())
        .or_else(|| fault.downcast_ref::<String>().map(String::as_str));
    let place = PLACE.lock().unwrap_or_else(PoisonError::into_inner);
    let at = place
        .as_ref()
        .map_or(String::new(), |at| format!(" at {at}"));
    Failure::internal(format!(
        "a fault of this program{at} ({}); please report this line with the call and its files",
        text.unwrap_or("no message")
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn a_fault_is_one_failure_with_its_message() {
        let failed = guarded(|| -> Result<(), Failure> { panic!("min > max") }).unwrap_err();
        assert_eq!(failed.code(), 1);
        assert!(
            format!("{failed:?}").contains("(min > max); please report"),
            "{failed:?}"
        );
        assert!(guarded(|| Ok(())).is_ok());
    }

    /// The answer is printed whatever becomes of its files; then the failure is told.
    #[test]
    fn an_answer_is_printed_though_its_files_fail() {
        let printed = Cell::new(0);
        let print = || {
            printed.set(printed.get() + 1);
            Ok(ExitCode::SUCCESS)
        };
        let keep = || Some("a.json".into());
        let full = deliver(|| Err(Failure::user("no room")), keep, print).unwrap_err();
        assert_eq!((full.code(), printed.get()), (2, 1));
        assert!(format!("{full:?}").contains("no room; the answer is in a.json"));
        let fault = deliver(|| panic!("a picture"), || None, print).unwrap_err();
        assert_eq!((fault.code(), printed.get()), (1, 2));
        assert!(deliver(|| Ok(()), || unreachable!(), print).is_ok());
    }
}
