//! Long work: shared out to threads and processes, kept piece by piece, gone on with after an interruption.
//!
//! Work is *numbered*: piece k depends on its number and the call alone, so that who does it, when, and how often it was
//! interrupted changes nothing.
//!
//! | to … | look at |
//! |---|---|
//! | keep finished pieces in a folder, and go on with it | [`WorkFolder`] |
//! | do a part of the pieces: of a job array, of the ranks of a cluster | [`Share`] |
//! | wait for the other ranks | [`Team`] |

mod crew;
mod folder;
#[doc(hidden)]
pub mod fuzzing;
mod lock;
mod manifest;
mod pieces;
mod share;
mod team;

use crew::share_out;
pub(crate) use folder::NewWork;
pub use folder::{WorkError, WorkFolder};
pub(crate) use manifest::{Manifest, checksum};
pub(crate) use pieces::{Piece, Pieces};
pub use share::{Share, ShareError};
pub use team::{Team, TeamError};
