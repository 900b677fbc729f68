//! Sealed trials: what a diagnosis says where the truth is known, but not to the diagnoser.
//!
//! ```text
//! seed ─ draw ─▶ truth ─┬─ world ─▶ record ─────────────── diagnose ─▶ answer ─┐
//!                       └─ keys.json ─ SHA-256 ─▶ seal.txt                     ├─▶ scorecard
//!                              └──── opened once every answer is there ────────┘
//! ```
//!
//! | step | file |
//! |---|---|
//! | the reference systems once more, written apart from twins and effects | `world/` |
//! | kinds of truth, listed effects in both forms, what nobody listed | `kind.rs`, `listed.rs`, `unlisted.rs` |
//! | the truth of one trial, and its records | `truth.rs` |
//! | keys, seal and records in a folder that can be gone on with | `folder.rs` |
//! | what the diagnoser says | `answer.rs` |
//! | what the opened key adds: the true effect's gain and share | `opened.rs` |
//! | the trials from end to end | `run.rs` |
//! | counts of right and wrong | `row.rs`, `score.rs` |
//!
//! See docs/withheld.md for how trials are made and what each score means.

mod answer;
mod error;
mod folder;
mod kind;
mod listed;
mod opened;
mod row;
mod run;
mod score;
mod truth;
mod unlisted;
mod world;

pub use answer::{Answer, Named, Outcome};
pub use error::WithheldError;
pub use kind::Kind;
pub use row::Row;
pub use run::{Sealed, Settings, Withheld};
pub(crate) use score::LEVEL;
pub use score::{Count, KindScore, Range, Scorecard, StatedBin};
