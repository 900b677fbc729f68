//! Files and folders: whole or absent, read within limits, resumed after a stop.
//!
//! | to … | look at |
//! |---|---|
//! | write a file that appears whole or not at all | `files` |
//! | read what others wrote, within limits | `untrusted` |
//! | keep pieces of long work in a folder, share it among jobs and ranks | [`work`] |

pub(crate) mod files;
pub(crate) mod untrusted;
pub mod work;
