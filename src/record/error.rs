//! Errors of drives, records and their files.

use super::channels::LARGEST;
use crate::math::three_digits;
use crate::setting::{count, number};
use crate::storage::files::with_remedy;
use crate::storage::untrusted::excerpt;
use std::path::{Path, PathBuf};

/// A fault in a drive, a record or its file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// A step that is not positive, not finite, or too small for a normal number.
    #[error("step = {} s; choose a positive number of seconds, at least 2.3e-308", number(*.0))]
    Step(f64),
    /// Times with more digits than a number has.
    #[error(
        "steps of {} s at times of {} s, whose last digits round to one time; let time begin at 0",
        number(three_digits(*step)),
        number(three_digits(*size))
    )]
    Resolution {
        /// Step that is left, in seconds.
        step: f64,
        /// Largest time, in seconds.
        size: f64,
    },
    /// No sample at all.
    #[error("no samples; at least one is needed")]
    Empty,
    /// Times, inputs, outputs or their channels of different lengths.
    #[error("{0}; both need the same number")]
    Lengths(String),
    /// Rows that all have one time.
    #[error("all rows have the time {} s; rows of one time are readings of one state: give at least two times", number(*.0))]
    OneTime(f64),
    /// A time that does not follow the one before it.
    #[error(
        "{} s follows {} s; time must increase: sort the rows, or give them their times",
        number(*time),
        number(*before)
    )]
    TimeOrder {
        /// Sample, from 0.
        sample: usize,
        /// Its time.
        time: f64,
        /// Time of the sample before.
        before: f64,
    },
    /// Rows of one time with different inputs.
    #[error(
        "input {channel} is {}, and {} in the row before, which has the same time; rows of one time are readings of one state: give them the same inputs, or each its own time",
        number(*value),
        number(*before)
    )]
    ReplicateInputs {
        /// Sample, from 0.
        sample: usize,
        /// Channel, from 1.
        channel: usize,
        /// The value.
        value: f64,
        /// Value in the row before.
        before: f64,
    },
    /// An output that no record has a value of.
    #[error(
        "output {0} has no value in any record; add a record with that sensor, name its column, or leave the output out of the twin"
    )]
    NoValue(String),
    /// A missing output where every one is needed.
    #[error(
        "row {row}, column {column} is missing; features need every output: resample the record, or fit or diagnose it without an estimator"
    )]
    Incomplete {
        /// Row of the file; the header is row 1.
        row: usize,
        /// Column of the file.
        column: String,
    },
    /// A step that differs from the others where all need to be the same.
    #[error(
        "row {row}, column {column}: a step of {} s in place of {} s; features need one step: resample the record, or fit or diagnose it without an estimator",
        number(*given),
        number(*expected)
    )]
    Uneven {
        /// Row of the file that the step leads to; the header is row 1.
        row: usize,
        /// Column of the times.
        column: String,
        /// The step in seconds.
        given: f64,
        /// The step in seconds that is needed: the study's, or the median one.
        expected: f64,
    },
    /// Steps that vary where a twin takes one.
    #[error(
        "row {row}, column {column}: a step of {} s in place of {} s; a black-box twin is simulated with one step: resample the record",
        number(*given),
        number(*expected)
    )]
    OneStep {
        /// Row of the file that the oddest step leads to; the header is row 1.
        row: usize,
        /// Column of the times.
        column: String,
        /// The step in seconds.
        given: f64,
        /// The median step.
        expected: f64,
    },
    /// A start that belongs to a time after the first row, or to one too long before it.
    #[error("{0}")]
    Start(String),
    /// A step that a record cannot be resampled to.
    #[error("{0}")]
    Resample(String),
    /// Too few rows with an output.
    #[error("{} with a measured output; at least 2 are needed", count(*.0, "row"))]
    TooFewValues(usize),
    /// No output channel.
    #[error("the record has no output; give at least one column y")]
    NoOutput,
    /// An input that is NaN or infinite, or an output that is infinite.
    #[error("{kind} {channel}, sample {sample} is {}; {kind}s must be finite", number(*value))]
    NotFinite {
        /// "input" or "output".
        kind: &'static str,
        /// Channel, from 1.
        channel: usize,
        /// Sample, from 0.
        sample: usize,
        /// The value.
        value: f64,
    },
    /// A channel whose squares overflow or vanish.
    #[error(
        "the largest value of {kind} {name} is {}; choose a unit in which it lies between {:e} and {LARGEST:e}",
        number(*size),
        1.0 / LARGEST
    )]
    Size {
        /// "input", "output" or "state".
        kind: &'static str,
        /// Channel or state.
        name: String,
        /// Its largest absolute value.
        size: f64,
    },
    /// Channels other than the twin's.
    #[error(
        "the record has {}, the twin has {expected}{names}; {twin}: choose the twin that this record is of, or correct the columns",
        count(*given, kind)
    )]
    Channels {
        /// "input" or "output".
        kind: &'static str,
        /// In the record.
        given: usize,
        /// In the twin.
        expected: usize,
        /// The twin's columns of this kind in parentheses after a space; empty where it has none.
        names: String,
        /// The twin and all its columns: "tanks takes the columns t,u,y".
        twin: String,
    },
    /// A file that cannot be read or written.
    #[error("{}: {}", path.display(), with_remedy(error))]
    Io {
        /// File.
        path: PathBuf,
        /// The system's error.
        error: std::io::Error,
    },
    /// A file whose columns are not those of a record.
    #[error("{}: {problem}", path.display())]
    Columns {
        /// File.
        path: PathBuf,
        /// Columns, what is wrong with them, and the remedy.
        problem: String,
    },
    /// A file whose numbers make no record.
    #[error("{}: {error}", path.display())]
    Within {
        /// File.
        path: PathBuf,
        /// The fault of the record.
        error: Box<RecordError>,
    },
    /// A file that holds no record.
    #[error("{}{problem}", path.display())]
    File {
        /// File.
        path: PathBuf,
        /// Row and column, what is wrong there, and the remedy.
        problem: String,
    },
}

impl RecordError {
    /// Adds the name of the twin to an error about its channels.
    pub(crate) fn of_twin(mut self, name: &str) -> Self {
        if let Self::Channels { twin, .. } = &mut self {
            *twin = twin.replacen("the twin", name, 1);
        }
        self
    }

    /// Adds the file that the record was read from.
    pub(crate) fn within(self, path: &Path) -> Self {
        Self::Within {
            path: path.into(),
            error: Box::new(self),
        }
    }

    /// Creates an error about a file as a whole.
    pub(super) fn file(path: &Path, problem: impl std::fmt::Display) -> Self {
        Self::File {
            path: path.into(),
            problem: format!(": {problem}"),
        }
    }

    /// Creates an error about a cell; the header is row 1.
    pub(super) fn cell(path: &Path, row: usize, column: &str, problem: String) -> Self {
        Self::File {
            path: path.into(),
            problem: format!(", row {row}, column {}: {problem}", excerpt(column)),
        }
    }

    /// Creates an error of the file system.
    pub(super) fn io(path: &Path, error: std::io::Error) -> Self {
        Self::Io {
            path: path.into(),
            error,
        }
    }
}
