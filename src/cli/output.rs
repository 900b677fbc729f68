//! Results: standard output, files that appear whole, folders that appear whole.

use super::Failure;
use crate::files::folder;
use serde_json::Value;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Prints a result; a reader that has gone away (`| head`) is no failure.
pub(super) fn print(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    let ends = if text.ends_with('\n') { "" } else { "\n" };
    match write!(out, "{text}{ends}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Failure::internal(format!("standard output: {error}")))
        }
        _ => Ok(()),
    }
}

/// Prints one JSON object.
pub(super) fn print_json(value: &Value) -> Result<(), Failure> {
    print(&serde_json::to_string_pretty(value).map_err(Failure::internal)?)
}

/// Refuses a path that is taken, and a folder that is not there, before the work starts.
pub(super) fn check_new(path: &Path) -> Result<(), Failure> {
    let name = path.display();
    if fs::symlink_metadata(path).is_ok() {
        return Err(Failure::user(format!(
            "{name} exists already; choose another --out, or remove it"
        )));
    }
    let folder = folder(path);
    if !folder.is_dir() {
        return Err(Failure::user(format!(
            "{name}: the folder {} does not exist; make it first",
            folder.display()
        )));
    }
    Ok(())
}

/// A folder that is filled beside its place and appears there whole.
pub(super) struct NewFolder {
    place: PathBuf,
    filling: tempfile::TempDir,
}

impl NewFolder {
    pub fn new(place: &Path) -> Result<Self, Failure> {
        let failed = |error| Failure::user(format!("{}: {error}", place.display()));
        Ok(Self {
            filling: tempfile::Builder::new()
                .prefix(".truetwin-")
                .tempdir_in(folder(place))
                .map_err(failed)?,
            place: place.into(),
        })
    }

    /// Where a file of the folder is written.
    pub fn file(&self, name: &str) -> PathBuf {
        self.filling.path().join(name)
    }

    pub fn write(&self, name: &str, text: &str) -> Result<(), Failure> {
        fs::write(self.file(name), text)
            .map_err(|error| Failure::user(format!("{}/{name}: {error}", self.place.display())))
    }

    /// Puts the folder in its place.
    pub fn finish(self) -> Result<(), Failure> {
        let failed = |error| Failure::user(format!("{}: {error}", self.place.display()));
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // A temporary folder is its maker's alone; a result is like any other folder.
            fs::set_permissions(self.filling.path(), fs::Permissions::from_mode(0o755))
                .map_err(failed)?;
        }
        fs::rename(self.filling.path(), &self.place).map_err(failed)?;
        // Moved away: nothing is left to remove.
        let _ = self.filling.keep();
        Ok(())
    }
}
