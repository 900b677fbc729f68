//! Diagnosis of the gap between a twin and a record: is there one, where, which effect explains it, how far it closes.
//!
//! | room | question |
//! |---|---|
//! | `run.rs`, `detect.rs`, `summary.rs` | order of the steps, and the summary of their results |
//! | `fitting/` | fits of a twin and its variants to the records, with a weak prior |
//! | `residuals/` | statistics of innovations, cut by time, state, lag and frequency |
//! | `hypotheses/` | what could be missing: listed effects and disturbances |
//! | `test/` | is anything missing? The statistics of the records against those of simulations |
//! | `explain/` | which effect: fit, order, accept, abstain |
//! | `locate/` | where: equations, time, states, onset; the missing term |
//! | `quantify/` | how far: share closed, smallest visible effect, next input |
//! | `outcome/` | results |
//! | `gain.rs` | gain of a known effect, for trials |
//!
//! The arrows between rooms run one way: fitting, residuals ← hypotheses ← test ← explain ← locate, quantify ← run.
//! A twin without equations has its likelihood from [`likelihood::ensemble`](crate::likelihood).
//!
//! See docs/diagnosing-a-gap.md for the mathematics and how to read the answer.
//!
//! ```
//! use std::sync::Arc;
//! use truetwin::diagnose::*;
//! use truetwin::effect::QuadraticDrag;
//! use truetwin::progress::Progress;
//! use truetwin::study::{RecordPlan, Study};
//! use truetwin::effect::*;
//! use truetwin::record::*;
//! use truetwin::twin::*;
//! use truetwin::twins::VanDerPol;
//!
//! // The real oscillator has a drag that the twin does not know.
//! let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 200))?;
//! let drag = QuadraticDrag { target: "x2".into(), magnitudes: Given::default() };
//! let real = augment(Arc::new(VanDerPol), vec![Arc::new(drag)])?;
//! let drive = Drive::autonomous(0.05, 200)?;
//! let outputs = real.simulate(&[1.5, 0.6], &drive, Noise::new(7, "measured", 0))?;
//! let record = Record::new(drive, outputs)?;
//!
//! let found: Diagnosis =
//!     diagnose(&study, &[record], None, &DiagnoseSettings::default(), &Progress::silent())?;
//! let detection: &Detection = &found.detection;
//! assert_eq!(found.verdict, Verdict::StructuralGap);
//! assert!(detection.p_value < detection.alpha);
//! let nu: &FittedParameter = &found.parameters[0];
//! assert_eq!(nu.name, "nu");
//! let unknown_starts_and_noise: &[FittedNuisance] = &found.nuisance;
//! assert!(unknown_starts_and_noise.is_empty());
//!
//! // Which effect: one, a class of rivals, or none of the listed.
//! let which: &Which = &found.which;
//! assert_ne!(which.decision, Decision::NotNeeded);
//! let first: &EffectFit = &which.effects[0];
//! assert!((0.0..=1.0).contains(&first.probability));
//! let tell_rivals_apart: Option<&NextInput> = which.next_input.as_ref();
//! assert!(tell_rivals_apart.is_none_or(|next| !next.rivals.is_empty()));
//!
//! // Where: in the equations, in time, at which values, at which delays and frequencies.
//! let place: &Where = &found.place;
//! let targets: &[TargetShare] = &place.targets;
//! let equations: &[Equation] = &place.equations;
//! for equation in equations {
//!     let ranges: &[TermRange] = &equation.term;
//!     assert!(ranges.iter().all(|range| range.low <= range.high));
//! }
//! let since: Option<&Onset> = place.onset.as_ref();
//! assert!(since.is_none_or(|onset| onset.time >= 0.0));
//! let maps: &Maps = &place.maps;
//! let (windows, regions): (&[Window], &[Region]) = (&maps.windows, &maps.regions);
//! let (channels, lags, bands): (&[Channel], &[Lag], &[Band]) = (&maps.channels, &maps.lags, &maps.bands);
//! /// Any of them says how much of the misfit it holds.
//! fn largest(cells: &[impl Cell]) -> f64 {
//!     cells.iter().map(Cell::share).fold(0.0, f64::max)
//! }
//! assert!([largest(windows), largest(regions), largest(channels)].iter().all(|share| *share <= 1.0));
//! assert!(lags.len() + bands.len() + targets.len() > 0);
//!
//! // How far it closes, what it could depend on, what this record could not have shown.
//! let closed: Option<&Shrinkage> = found.shrinkage.as_ref();
//! assert!(closed.is_none_or(|shrinkage| shrinkage.before >= 0.0));
//! let missing: Option<&Discovery> = found.discovery.as_ref();
//! let terms: &[Term] = missing.map_or(&[], |discovery| &discovery.terms);
//! assert!(terms.iter().all(|term| (0.0..=1.0).contains(&term.inclusion)));
//! let visible: &[Visible] = &found.power;
//! assert!(visible.iter().all(|effect| !effect.id.is_empty()));
//! let runs: &FreeRuns = &found.free_runs;
//! assert_eq!(runs.times.len(), 200);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod context;
mod detect;
mod error;
mod explain;
mod fitting;
mod gain;
mod hypotheses;
mod locate;
mod outcome;
mod quantify;
mod residuals;
mod run;
mod settings;
mod summary;
mod test;
mod thresholds;

pub use error::{DiagnoseError, GivenRecord};
pub(crate) use gain::{gain_of, held_out_score};
pub use outcome::{
    Band, Cell, Channel, Decision, Detection, Diagnosis, Discovery, EffectFit, Equation,
    FittedNuisance, FittedParameter, FreeRuns, Lag, Maps, NextInput, Onset, Region, Shrinkage,
    TargetShare, Term, TermRange, Verdict, Visible, Where, Which, Window,
};
pub(crate) use quantify::held_out::{SHORTEST_SPLIT, held_out_from};
pub use run::diagnose;
pub use settings::DiagnoseSettings;

/// Nats within which explanations are rivals.
pub(crate) const RIVALS: f64 = thresholds::Thresholds::RIVALS;
