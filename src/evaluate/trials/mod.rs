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
//!
//! ```
//! use truetwin::evaluate::paper::reference_studies;
//! use truetwin::progress::Progress;
//! use truetwin::evaluate::trials::*;
//! use truetwin::storage::work::Share;
//!
//! let study = &reference_studies()?[0];
//! let settings = Settings { trials: 2, kinds: vec![Kind::None], detection_only: true, ..Settings::default() };
//! let place = tempfile::tempdir()?;
//! let folder = place.path().join("trials");
//! let sealed: Sealed = Withheld::new(study, settings)?.seal(&folder, &Progress::silent())?;
//! assert_eq!(sealed.seal().len(), 64); // the SHA-256 of the keys, to be published now
//!
//! // Diagnoses come from the records alone; then the keys are opened.
//! let answers: Vec<Answer> = sealed.answer(Share::WHOLE, &Progress::silent())?;
//! let outcome: &Outcome = answers[0].outcome.as_ref().ok_or("the diagnosis did not fail")?;
//! let named: Option<&Named> = outcome.top();
//! assert!(named.is_none()); // nothing is missing, and nothing was looked for
//! sealed.open_keys(Share::WHOLE, &Progress::silent())?;
//!
//! let card: Scorecard = sealed.score(&Progress::silent())?;
//! let alarms: Count = card.false_alarms;
//! assert_eq!(alarms.of, 2);
//! assert!(alarms.interval().0 <= alarms.share().unwrap_or_default());
//! let row: &Row = &card.rows[0];
//! assert_eq!(row.kind, Kind::None);
//! let by_kind: &[KindScore] = &card.by_kind;
//! assert_eq!(by_kind.iter().map(|score| score.right.of).sum::<u64>(), 2);
//! let (by_gain, reliability): (&[Range], &[StatedBin]) = (&card.by_gain, &card.reliability);
//! assert!(by_gain.iter().all(|range| range.detected.of == 0) && reliability.iter().all(|bin| bin.right.of == 0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

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
pub use score::{Count, KindScore, Range, Scorecard, StatedBin};
