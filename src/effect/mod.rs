//! Effects that a twin may lack: laws with magnitudes, each with a value that switches it off.
//!
//! The library is a table a kind of target in `effect/library/`, one row an effect; `docs/choosing-effects.md` lists it.
//! An effect of one's own is an [`EffectKind`] given to [`Study::with_effects`](crate::study::Study::with_effects).
//!
//! Several effects on one signal act in the order of the list, whatever the order of a file; the measurement noise enters
//! after rectification. Starts of a fit are for a signal of size 1 and a step of 1 s.
//!
//! | for | look at |
//! |---|---|
//! | a law and its magnitudes | [`EffectKind`], [`Magnitude`] |
//! | all kinds, files, where each can stand | [`Catalogue`] |
//! | one effect at one target | [`Effect`], [`EffectKey`] |
//! | a twin with effects | [`augment`] |

mod augment;
mod catalogue;
mod check;
mod file;
mod key;
mod kind;
mod law;
mod library;
mod magnitude;
mod marks;
mod placed;

pub use augment::augment;
pub(crate) use augment::augment_late;
pub use catalogue::Catalogue;
pub(crate) use check::targets;
pub(crate) use file::line_of_effect;
pub use key::{EffectKey, EffectPattern};
pub use kind::{EffectKind, OtherState};
pub use law::ForcePoint;
pub(crate) use law::TargetKind;
pub(crate) use library::{clamp, lag};
pub use magnitude::{Magnitude, Shape};
pub(crate) use marks::{OutputMark, clipped, on_levels, rounded, stops};
pub use placed::Effect;
pub(crate) use placed::{EffectEntry, channel, magnitude_unit};
