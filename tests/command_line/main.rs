//! The command line and everything that is started from it: banks, external programs, FMUs, ranks, Parquet records.

mod bank;
mod cli;
mod external;
#[cfg(feature = "mpi")]
#[path = "../common/files.rs"]
mod files;
#[cfg(feature = "fmi")]
mod fmu;
#[cfg(feature = "mpi")]
mod mpi;
#[cfg(feature = "parquet")]
mod parquet;
#[path = "../common/studies.rs"]
mod studies;
#[cfg(feature = "mpi")]
#[path = "../common/timeless.rs"]
mod timeless;
