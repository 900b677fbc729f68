//! Options that several verbs share.

use super::failure::Failure;
use crate::estimator::PresetName;
use crate::record::{Columns, RecordReader};
use crate::study::Study;
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use std::time::Duration;

/// An external twin, for this call alone.
#[derive(Debug, Args)]
#[command(next_help_heading = "External simulator")]
pub(super) struct External {
    /// Simulator program that reads and writes lines of JSON; started without a shell.
    #[arg(long, global = true, value_name = "COMMAND")]
    pub program: Option<String>,
    /// FMU (FMI 2.0 or 3.0: model exchange or co-simulation); needs a build with the feature fmi.
    #[arg(long, global = true, value_name = "M.fmu", conflicts_with = "program")]
    pub fmu: Option<PathBuf>,
    /// Parameters, inputs and outputs to use from the FMU; if no variable of a kind is named, all of that kind are used.
    #[arg(long, global = true, value_name = "NAME,..", value_delimiter = ',')]
    pub variables: Vec<String>,
    /// Take the co-simulation of an FMU that offers its equations as well: it then is a black box.
    #[arg(long, global = true)]
    pub co_simulation: bool,
    /// Number of copies of the program or FMU that run at once [default: one per thread].
    #[arg(long, global = true, value_name = "N")]
    pub workers: Option<usize>,
    /// Time limit for one answer of the program, its start and description included [default: 60].
    #[arg(long, global = true, value_name = "SECONDS")]
    pub timeout: Option<f64>,
}

/// The twin and its setting; with `--program`, that program's twin by default.
#[derive(Debug, Clone, Args)]
#[group(multiple = false)]
pub(super) struct Subject {
    /// Name of a twin; `truetwin twins` lists them.
    #[arg(long)]
    pub twin: Option<String>,
    /// Study file (TOML): twin, step, prior, noise, limits, start, features.
    #[arg(long, value_name = "S.toml")]
    pub study: Option<PathBuf>,
}

/// Names of the columns of record files.
#[derive(Debug, Clone, Args)]
pub(super) struct FileColumns {
    /// Column of the record file for each name in the twin, as in t=time,u=pump,y=level [default: t, u or u1,u2,…, y or y1,y2,…,
    /// or those of [record] columns in a study that is given].
    #[arg(long, value_name = "NAME=COLUMN,..")]
    columns: Option<Columns>,
}

impl FileColumns {
    /// Refuses columns where the call reads no file that has them; `option` would name one.
    pub fn check_used(&self, is_used: bool, option: &str) -> Result<(), Failure> {
        match self.columns.is_some() && !is_used {
            true => Err(Failure::user(format!(
                "--columns: no file with columns is read; give {option}, or remove it"
            ))),
            false => Ok(()),
        }
    }

    /// Creates a reader of the records of a study; it refuses those with other channels than the twin's.
    pub fn reader(&self, study: &Study) -> RecordReader {
        self.reader_of_any(study).for_twin(study.name())
    }

    /// As [`reader`](Self::reader), for a verb that looks at the channels itself.
    pub fn reader_of_any(&self, study: &Study) -> RecordReader {
        let columns = self.columns.clone();
        let columns = columns.unwrap_or_else(|| study.file().record.columns.clone());
        RecordReader::new(columns, Some(study.twin().signals()))
    }

    /// Creates a reader of records without a twin.
    pub fn reader_without_twin(&self) -> RecordReader {
        RecordReader::new(self.columns.clone().unwrap_or_default(), None)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum PresetArgument {
    /// The paper's recipe.
    Paper,
    /// The recipe that works best on any twin.
    Default,
}

impl From<PresetArgument> for PresetName {
    fn from(argument: PresetArgument) -> Self {
        match argument {
            PresetArgument::Paper => Self::Paper,
            PresetArgument::Default => Self::Default,
        }
    }
}

/// Parses a number of runs.
pub(super) fn at_least_one(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("choose at least 1".into()),
        Ok(number) => Ok(number),
        // Failure::usage has the words.
        Err(error) => Err(error.to_string()),
    }
}

/// Parses a duration in seconds.
pub(super) fn seconds(text: &str) -> Result<Duration, String> {
    let number: f64 = text.parse().map_err(|error| format!("{error}"))?;
    Duration::try_from_secs_f64(number).map_err(|_| "choose seconds from 0 to 1e19".to_owned())
}
