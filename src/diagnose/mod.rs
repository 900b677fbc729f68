//! Whether a twin explains a record, and if not, where, by which effect, and how far it closes the gap.
//!
//! | step | file |
//! |---|---|
//! | the way of a diagnosis | `run.rs`, `detect.rs` |
//! | fit θ with a weak prior | `fit.rs`, `problem.rs`, `axis.rs`, `base_fit.rs` |
//! | what each listed effect and each catch-all would gain | `candidate.rs`, `catch_all.rs`, `plan.rs`, `choice.rs`, `scales.rs`, `variant.rs`, `dictionary.rs`, `scan.rs` |
//! | are the innovations white? | `omnibus.rs` |
//! | what all of that is where nothing is wrong | `null.rs` |
//! | what a validation record says | `evalue.rs` |
//! | fit the explanations, order them, accept, abstain | `frequency.rs`, `attribute.rs`, `decide.rs`, `several.rs` |
//! | where, in the equations, in time, in the states, since when | `localise/`, `map.rs`, `place.rs`, `onset.rs` |
//! | what the missing term depends on, where no listed effect fits | `missing_term.rs`, `discover.rs` |
//! | how far, on held-out data | `shrink.rs`, `held_out.rs`, `posterior.rs` |
//! | the kinds of gap | `verdict.rs` |
//! | which effects the record could have revealed | `power.rs` |
//! | which record would tell rivals apart | `next_input.rs` |
//! | what is reported of all that | `summary.rs`, `result.rs` |
//! | what a known effect would gain, for trials | `gain.rs` |
//! | all of that for a twin without equations | `black_box/` |
//!
//! See docs/diagnosing-a-gap.md for the mathematics and how to read the answer.
//!
//! ```
//! //! use truetwin::diagnose::*;
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

mod attribute;
mod axis;
mod base_fit;
mod black_box;
mod candidate;
mod catch_all;
mod choice;
mod correlation;
mod decide;
mod detect;
mod dictionary;
mod discover;
mod evalue;
mod fit;
mod frequency;
mod gain;
mod held_out;
mod localise;
mod map;
mod missing_term;
mod next_input;
mod null;
mod omnibus;
mod onset;
mod place;
mod plan;
mod posterior;
mod power;
mod problem;
mod result;
mod run;
mod scales;
mod scan;
mod several;
mod shrink;
mod summary;
mod variant;
mod verdict;

pub(crate) use gain::{gain_of, held_out_score};
pub(crate) use held_out::{SHORTEST_SPLIT, held_out_from};
pub use map::{Band, Cell, Channel, Equation, Lag, Maps, Onset, Region, TermRange, Where, Window};
pub use result::{
    Decision, Detection, Diagnosis, Discovery, EffectFit, FittedNuisance, FittedParameter,
    FreeRuns, NextInput, TargetShare, Term, Verdict, Visible, Which,
};
pub use run::diagnose;
pub use shrink::Shrinkage;

use crate::effect::EffectError;
use crate::likelihood::kalman::FilterError;
use crate::progress::Cancelled;
use crate::record::{Record, RecordError};
use crate::setting::SettingError;
use crate::study::Study;
use crate::twin::{ParameterError, SimulationError, Twin};
use std::fmt;

/// Settings of a diagnosis.
///
/// | setting | default | range | meaning |
/// |---|---|---|---|
/// | `alpha` | 0.05 | (0, 1) | level of every test |
/// | `replicates` | 60 | ≥ 1/alpha | simulations of the structural test |
/// | `unexplained` | 99 | ≥ 50 | simulations of the test that a named effect must pass |
/// | `seed` | 1 | | of everything random |
/// | `without` | none | ids, or `id@target` | effects that are not to be named |
/// | `initial` | none | | θ that an estimator gave, a start of the fit |
/// | `detection_only` | no | | stop after the verdict: neither where, nor which, nor how far |
///
/// ```
/// use truetwin::diagnose::DiagnoseSettings;
///
/// let quick = DiagnoseSettings { detection_only: true, seed: 7, ..DiagnoseSettings::default() };
/// assert_eq!(quick.alpha, 0.05);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct DiagnoseSettings {
    /// Level of every test.
    pub alpha: f64,
    /// Simulations of the structural test.
    pub replicates: usize,
    /// Simulations of the test with the effect added.
    pub unexplained: usize,
    /// Seed of everything random.
    pub seed: u64,
    /// Effects that are not to be named: `id` or `id@target`.
    pub without: Vec<String>,
    /// θ from an estimator.
    pub initial: Option<Vec<f64>>,
    /// Stop after the verdict.
    pub detection_only: bool,
}

impl Default for DiagnoseSettings {
    fn default() -> Self {
        Self {
            alpha: 0.05,
            replicates: 60,
            unexplained: 99,
            seed: 1,
            without: vec![],
            initial: None,
            detection_only: false,
        }
    }
}

/// Why there is no diagnosis.
///
/// ```
/// use truetwin::diagnose::{DiagnoseError, DiagnoseSettings, diagnose};
/// use truetwin::progress::Progress;
/// use truetwin::study::{RecordPlan, Study};
/// use truetwin::twins::VanDerPol;
///
/// let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 200))?;
/// let nothing = diagnose(&study, &[], None, &DiagnoseSettings::default(), &Progress::silent());
/// assert!(matches!(nothing, Err(DiagnoseError::NoRecord)));
/// # Ok::<(), truetwin::study::StudyError>(())
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DiagnoseError {
    /// No record.
    #[error("no record was given; give at least one")]
    NoRecord,
    /// Records of different steps.
    #[error("{record} has a step of {given} s, the first record {expected} s; resample it")]
    Steps {
        /// Which.
        record: GivenRecord,
        /// Its step.
        given: f64,
        /// That of the first.
        expected: f64,
    },
    /// Too short to say anything.
    #[error("{record} has {samples} samples; at least {least} are needed, measure longer")]
    TooShort {
        /// Which.
        record: GivenRecord,
        /// Its samples.
        samples: usize,
        /// What is needed.
        least: usize,
    },
    /// A setting that cannot be used.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// An effect to leave out that there is not.
    #[error(
        "--without names {0}, which is no effect of this twin; `truetwin effects --twin T` lists them"
    )]
    Without(String),
    /// The filter works nowhere.
    #[error(
        "the twin can be fitted to the record from no start; check units and step of the record, and the prior"
    )]
    NoFit,
    /// Channels that are not the twin's.
    #[error("{record} is not of this twin: {error}")]
    Channels {
        /// Which.
        record: GivenRecord,
        /// What is wrong.
        error: RecordError,
    },
    /// Of a part of a record.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// Of a filter.
    #[error(transparent)]
    Filter(#[from] FilterError),
    /// Of an effect.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// Of parameters.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// Of a simulation.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// Stopped.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl DiagnoseError {
    /// The record that is to blame, where one is.
    pub fn record(&self) -> Option<GivenRecord> {
        match self {
            Self::Steps { record, .. }
            | Self::TooShort { record, .. }
            | Self::Channels { record, .. } => Some(*record),
            Self::NoFit => Some(GivenRecord::Measured(0)),
            _ => None,
        }
    }
}

/// One of the records that a diagnosis was given.
///
/// ```
/// use truetwin::diagnose::{DiagnoseError, DiagnoseSettings, GivenRecord, diagnose};
/// use truetwin::progress::Progress;
/// use truetwin::study::{RecordPlan, Study};
/// use truetwin::effect::*;
/// use truetwin::record::*;
/// use truetwin::twin::*;
/// use truetwin::twins::VanDerPol;
///
/// let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 200))?;
/// let drive = Drive::autonomous(0.05, 20)?;
/// let short = Record::new(drive.clone(), VanDerPol.simulate(&[1.5], &drive, Noise::OFF)?)?;
/// let error: DiagnoseError =
///     diagnose(&study, &[short], None, &DiagnoseSettings::default(), &Progress::silent()).unwrap_err();
/// assert_eq!(error.record(), Some(GivenRecord::Measured(0)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum GivenRecord {
    /// Its place among the records, from 0.
    Measured(usize),
    /// The one that is held out.
    Validation,
}

impl fmt::Display for GivenRecord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Measured(index) => write!(f, "record {}", index + 1),
            Self::Validation => f.write_str("the validation record"),
        }
    }
}

/// What all steps share.
struct Setting<'a> {
    study: &'a Study,
    twin: &'a Twin,
    validation: Option<&'a [Record]>,
    /// The records and the validation record.
    together: Option<&'a [Record]>,
    /// Whether the twin has no process noise: its free run is to follow the record, and neither noise nor a disturbance
    /// is a rival: either would explain anything.
    follows: bool,
    /// Whether the twin is a simulator without noise of its own, and has been given measurement noise.
    silent: bool,
}

impl<'a> Setting<'a> {
    /// Of the twin as [`measured`](black_box::measured) shows it.
    fn new(
        study: &'a Study,
        (twin, silent): &'a (Twin, bool),
        records: &[Record],
        validation: Option<&'a [Record]>,
        together: Option<&'a [Record]>,
    ) -> Self {
        Self {
            study,
            twin,
            validation,
            together,
            follows: *silent || detect::without_process_noise(twin, &records[0]),
            silent: *silent,
        }
    }
}
