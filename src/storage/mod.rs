//! Files and folders: complete or absent, read within limits, resumed after a stop.
//!
//! | to … | look at |
//! |---|---|
//! | write a file that appears complete or not at all | `files` |
//! | write a folder likewise, remove leftovers of killed processes | `unfinished` |
//! | read files of others, within limits | `untrusted` |
//! | keep pieces of long work in a folder, share it among jobs and ranks | `work` |

mod error;
pub(crate) mod files;
pub(crate) mod fuzzing;
mod unfinished;
pub(crate) mod untrusted;
pub(crate) mod work;

pub use error::StorageError;
pub(crate) use unfinished::{NewFolder, sweep_beside};
