//! Errors of the system with what to do about them.

use std::io;
use std::path::Path;

/// Returns the folder that a path lies in.
pub(crate) fn folder(path: &Path) -> &Path {
    path.parent()
        .filter(|parent| !parent.as_os_str().is_empty())
        .unwrap_or(Path::new("."))
}

/// Returns the message of a system error with its remedy.
pub(crate) fn with_remedy(error: &io::Error) -> String {
    let remedy = match error.kind() {
        io::ErrorKind::NotFound => "check the path",
        io::ErrorKind::IsADirectory => "name a file, not a folder",
        io::ErrorKind::PermissionDenied => "change its permissions, or choose another place",
        io::ErrorKind::AlreadyExists | io::ErrorKind::DirectoryNotEmpty => {
            "choose another name, or remove it"
        }
        io::ErrorKind::ReadOnlyFilesystem => "choose another place",
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            "make room, or choose another place"
        }
        io::ErrorKind::InvalidData => "save it as UTF-8 text",
        io::ErrorKind::Unsupported => "remove it, and put a file or folder of its own there",
        io::ErrorKind::FileTooLarge if error.raw_os_error().is_some() => {
            "raise the limit of file sizes (ulimit -f), or choose another place"
        }
        io::ErrorKind::FileTooLarge => "check that it is the file that you mean",
        _ => "check the path and the disk",
    };
    format!("{error}; {remedy}")
}
