//! Measured data: time grid, inputs and outputs, and their files.
//!
//! | to … | look at |
//! |---|---|
//! | hand over inputs | [`Drive`] |
//! | take a measurement | [`Record`] |
//! | read and write CSV, read Parquet | [`Record::read`], [`Record::write`], [`Drive::read`] |

mod channels;
mod columns;
mod csv;
mod drive;
mod error;
mod measured;
mod parquet;
mod resample;
mod rounding;
mod stamp;
mod table;
mod text;

pub(crate) use channels::{LARGEST, column_names};
pub use channels::{Quantity, Signals};
pub(crate) use columns::Columns;
pub(crate) use csv::{RecordReader, drive_csv_text, named_csv_text, parse_record, record_csv_text};
pub use drive::{Drive, Signal};
pub(crate) use drive::{UNIFORM, check_size, check_sizes, on_line};
pub use error::RecordError;
pub use measured::Record;
pub(crate) use resample::{InputRule, Resampled, resample};
pub(crate) use rounding::{distinct, step_of};
pub(crate) use table::MOST_SAMPLES;
