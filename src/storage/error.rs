//! The error of files and work folders.

use crate::setting::count;
use std::io;
use std::path::{Path, PathBuf};

/// Error of a file, a work folder, or of sharing work among threads and processes.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StorageError {
    /// A file or folder that cannot be read or written.
    #[error("{}: {}", path.display(), with_remedy(error))]
    Io {
        /// File or folder.
        path: PathBuf,
        /// The system's error.
        error: io::Error,
    },
    /// An output in a folder that does not exist.
    #[error("{}: {} does not exist; make it first", .0.display(), folder(.0).display())]
    NoParent(PathBuf),
    /// An output in what is no folder.
    #[error("{}: {} is a file; name a place in a folder", .0.display(), folder(.0).display())]
    InFile(PathBuf),
    /// An output path that is a link to nothing.
    #[error("{} is a link to {}, which does not exist; remove it, or choose another place", path.display(), to.display())]
    Dangling {
        /// Output.
        path: PathBuf,
        /// Where the link leads.
        to: PathBuf,
    },
    /// An output path that names a folder where a file is written.
    #[error("{} names a folder, the output is a file; name a file", .0.display())]
    NoFile(PathBuf),
    /// An output path with a name of unfinished files.
    #[error("{}: names that begin with .truetwin- are those of unfinished files; choose another name", .0.display())]
    Reserved(PathBuf),
    /// Something at the place of an unfinished folder that this program has not put there.
    #[error("{} is in the way, and is no unfinished work of this program; remove it", .0.display())]
    InTheWay(PathBuf),
    /// A finished result whose place was taken while it was made.
    #[error("{} was taken while the work went on; the result is in {}", place.display(), kept.display())]
    Kept {
        /// Output.
        place: PathBuf,
        /// Where the result is.
        kept: PathBuf,
    },
    /// A finished result that cannot be written to its place.
    #[error("{problem}; the result is in {}", kept.display())]
    Elsewhere {
        /// Why it cannot.
        problem: String,
        /// Where the result is.
        kept: PathBuf,
    },
    /// A path that a file keeps as text, which it is not.
    #[error("{}: this path is kept in a file as text, and is no UTF-8; rename it", .0.display())]
    NoText(PathBuf),
    /// An output path that holds something else.
    #[error(
        "{} exists already and is no {verb} folder ({reason}); choose another folder or remove it",
        path.display()
    )]
    Taken {
        /// Output.
        path: PathBuf,
        /// Verb that was to resume it.
        verb: &'static str,
        /// Problem of its manifest.
        reason: String,
    },
    /// An input folder that the verb did not make, or whose manifest is damaged.
    #[error(
        "{}: no {verb} folder ({reason}); name one, or remove this and make it again",
        path.display()
    )]
    Foreign {
        /// Input.
        path: PathBuf,
        /// Verb that makes such folders.
        verb: &'static str,
        /// Problem of its manifest.
        reason: String,
    },
    /// A folder of another call.
    #[error(
        "{} holds the work of another call: {difference}; rerun that call to resume it, choose another folder, or remove it",
        path.display()
    )]
    OtherCall {
        /// Folder.
        path: PathBuf,
        /// First difference between the calls.
        difference: String,
    },
    /// A folder whose work this version cannot go on with.
    #[error(
        "{} holds the work of another version of truetwin ({difference}), which alone can go on with it; choose another folder, or remove it",
        path.display()
    )]
    OtherVersion {
        /// Folder.
        path: PathBuf,
        /// Layout or version, then and now.
        difference: String,
    },
    /// Work that would not be the same if it were resumed.
    #[error(
        "two simulations with one seed differ, so that no work on them can be resumed; take all randomness from the seed, and none from clocks or addresses"
    )]
    Unrepeatable,
    /// An output that another process is writing.
    #[error(
        "another run is writing to {}; wait until it is done or stop it, or choose another place",
        .0.display()
    )]
    Busy(PathBuf),
    /// A damaged piece of a work folder.
    #[error("{}: cannot be used ({reason}); remove it, and the next run makes it again", path.display())]
    Piece {
        /// File.
        path: PathBuf,
        /// Problem of its content.
        reason: String,
    },
    /// A part of a work folder that is gone.
    #[error("{}: is missing; remove the folder and start again", .0.display())]
    Missing(PathBuf),
    /// A text that is no share.
    #[error("\"{0}\" is no share; write i/n: share i of n, such as 1/4")]
    Share(String),
    /// Threads that the system refuses to start.
    #[error(
        "cannot start {} ({error}); {}raise the limits of memory and processes (ulimit -v, ulimit -u)",
        count(*threads, "thread"),
        if *threads > 1 { "choose fewer, or " } else { "" }
    )]
    Threads {
        /// Number of threads asked for.
        threads: usize,
        /// The system's error.
        error: String,
    },
    /// Several ranks of a build without MPI: each would do all of the work.
    #[error(
        "started as {0} ranks, but this build has no MPI; build it with the feature mpi, or divide the work into shares"
    )]
    NoMpi(usize),
    /// An MPI library that does not start.
    #[error(
        "MPI does not start; check the launcher and the library that this build is linked with"
    )]
    MpiStart,
}

impl StorageError {
    /// Creates an error of the system about a path.
    pub fn io(path: &Path, error: io::Error) -> Self {
        Self::Io {
            path: path.into(),
            error,
        }
    }

    /// Creates an error about what a folder was made with.
    pub(crate) fn kept(path: &Path, error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::NotFound => Self::Missing(path.into()),
            _ => Self::io(path, error),
        }
    }

    /// Creates an error for threads that do not start.
    pub(crate) fn threads(threads: usize, error: impl std::fmt::Display) -> Self {
        Self::Threads {
            threads,
            error: error.to_string(),
        }
    }
}

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
        io::ErrorKind::InvalidFilename => "choose a shorter name",
        io::ErrorKind::NotSeekable => "save it as a file first",
        io::ErrorKind::Unsupported => "remove it, and put a file or folder of its own there",
        io::ErrorKind::FileTooLarge if error.raw_os_error().is_some() => {
            "raise the limit of file sizes (ulimit -f), or choose another place"
        }
        io::ErrorKind::FileTooLarge => "check that it is the file that you mean",
        // Too many open files, of the system or of the process.
        _ if matches!(error.raw_os_error(), Some(23 | 24)) => {
            "raise the limit of open files (ulimit -n)"
        }
        _ => "check the path and the disk",
    };
    format!("{error}; {remedy}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_of_the_system_have_remedies_that_work() {
        let many = with_remedy(&io::Error::from_raw_os_error(24));
        assert!(
            many.ends_with("raise the limit of open files (ulimit -n)"),
            "{many}"
        );
        let [one, two] = [1, 2].map(|n| StorageError::threads(n, "no").to_string());
        assert!(
            one.starts_with("cannot start 1 thread (no); raise the"),
            "{one}"
        );
        assert!(
            two.contains("2 threads (no); choose fewer, or raise"),
            "{two}"
        );
    }
}
