//! Files and folders: complete or absent, read within limits, resumed after a stop.
//!
//! | to … | look at |
//! |---|---|
//! | write a file that appears complete or not at all | `files` |
//! | write a folder likewise, remove leftovers of killed processes | `unfinished` |
//! | read files of others, within limits | `untrusted` |
//! | know the checksum of what was read | `reading` |
//! | check the place of an output before the work | `place` |
//! | keep pieces of long work in a folder, share it among jobs and ranks | `work` |

pub(crate) mod checksum;
mod error;
pub(crate) mod files;
mod names;
pub(crate) mod place;
pub(crate) mod reading;
mod unfinished;
pub(crate) mod untrusted;
pub(crate) mod work;

pub use error::StorageError;
pub(crate) use unfinished::{NewFolder, remove_unfinished, result, sweep_beside};
