//! Long work: divided among threads and processes, kept piece by piece, resumed after an interruption.
//!
//! Work is *numbered*: piece k depends only on its number and the call, so that neither the process that makes it, nor the
//! time, nor interruptions change it.
//!
//! | to … | look at |
//! |---|---|
//! | keep finished pieces in a folder, and resume it | [`WorkFolder`] |
//! | do a share of the pieces: of a job array, of the ranks of a cluster | [`Share`] |

mod folder;
mod manifest;
mod piece;
mod pieces;
mod ranks;
mod share;

pub use folder::WorkFolder;
pub(crate) use folder::has_pieces;
pub(crate) use manifest::{Manifest, checksum};
pub(crate) use pieces::{Piece, Pieces};
pub(crate) use ranks::Ranks;
pub use share::Share;
