//! Names that every verb uses.

pub(super) use crate::cli::context::{Context, Verb};
pub(super) use crate::cli::failure::{Failure, InFile};
pub(super) use crate::cli::options::{FileColumns, PresetArgument, Subject, at_least_one};
pub(super) use crate::cli::output;
pub(super) use crate::cli::provenance::Provenance;
pub(super) use crate::cli::records;
pub(super) use crate::storage::NewFolder;
pub(super) use crate::storage::files::write_result;
pub(super) use crate::study::Study;
pub(super) use clap::Args;
pub(super) use serde_json::{Value, json};
pub(super) use std::path::{Path, PathBuf};
pub(super) use std::process::ExitCode;
