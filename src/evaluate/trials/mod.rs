//! Sealed trials: diagnoses of records whose truth is known, but not to the diagnoser.
//!
//! ```text
//! seed ─ draw ─▶ truth ─┬─ world ─▶ record ─────────────── diagnose ─▶ answer ─┐
//!                       └─ keys.json ─ SHA-256 ─▶ seal.txt                     ├─▶ scorecard
//!                              └──── opened once every answer is there ────────┘
//! ```
//!
//! See docs/withheld.md for how trials are made and what each score means.
//!
//! ```
//! use truetwin::evaluate::paper::reference_studies;
//! use truetwin::progress::Progress;
//! use truetwin::evaluate::trials::*;
//!
//! let study = &reference_studies()?[0];
//! let settings = TrialSettings { trials: 2, kinds: vec![Kind::None], detection_only: true, ..TrialSettings::default() };
//! let place = tempfile::tempdir()?;
//! let folder = place.path().join("trials");
//! let sealed: Sealed = Withheld::new(study, settings)?.seal(&folder, &Progress::silent())?;
//! assert_eq!(sealed.seal().len(), 64); // the SHA-256 of the keys, to be published now
//!
//! // Diagnoses come from the records alone; then the keys are opened.
//! let card: Scorecard = sealed.score(&Progress::silent())?;
//! assert_eq!(card.trials, 2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod answer;
mod correlation;
mod draft;
#[cfg(test)]
pub(crate) mod fixture;
mod folder;
mod information;
mod law;
mod listed;
mod numbers;
mod places;
mod row;
mod run;
mod scene;
mod score;
mod settings;
mod steadiness;
mod truth;
mod world;

pub use law::Families;
pub(crate) use row::TrialRow;
pub use run::{Sealed, Withheld};
pub use score::Scorecard;
pub(crate) use score::{Breakdown, BreakdownLine};
pub use settings::{Kind, TrialSettings};
pub use world::NuisanceKind;
