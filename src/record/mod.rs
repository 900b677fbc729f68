//! Measured data: time grid, inputs and outputs, and their files.
//!
//! | to … | look at |
//! |---|---|
//! | hand over inputs | [`Drive`] |
//! | take a measurement | [`Record`] |
//! | read and write CSV, read Parquet | [`read_record`], [`write_record`], [`read_drive`] |

mod channels;
mod csv;
mod drive;
mod measured;
mod parquet;

pub use channels::{Quantity, Signals};
pub use csv::{
    CsvError, drive_csv_text, parse_record, read_drive, read_record, record_csv_text, write_record,
};
pub use drive::{Drive, DriveError, Signal};
pub use measured::{Record, RecordError};
