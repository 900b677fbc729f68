//! # truetwin
//!
//! Calibrates simulators ("digital twins") against measured data and diagnoses what they are missing.
//!
//! ```text
//! prior ─ simulate ─▶ bank ─ features ─▶ train ─▶ estimator            pretrain, once
//! record ─ features ─▶ estimator ─▶ θ_init ─▶ gate ─ consistent ─▶ θ̂      estimate, each record
//!                                              │ not
//!                        Gauss–Newton ─▶ cloud of simulations ─▶ tuned heads ─▶ θ̂ ─▶ gate again
//! records ─▶ fit ─▶ effects and unknown functions weighed ─▶ which, where, how far      diagnose, no training
//! ```
//!
//! ```
//! use truetwin::prelude::*;
//! use truetwin::diagnose::Verdict;
//!
//! /// A leaking tank: ḣ = u − k·h, with a noisy level sensor.
//! struct Tank;
//!
//! impl StateSpace for Tank {
//!     fn outline(&self) -> Outline {
//!         Outline::new()
//!             .parameter(Parameter::new("k", "1/s", 0.2, 1.0).within(0.05, 3.0))
//!             .state("h", "m")
//!             .input("u", "m/s")
//!             .output("y", "m")
//!     }
//!     fn drift(&self, now: &Now, x: &[f64], dx: &mut [f64]) {
//!         dx[0] = now.u[0] - now.theta[0] * x[0];
//!     }
//!     fn observe(&self, _: &Now, x: &[f64], y: &mut [f64]) {
//!         y[0] = x[0];
//!     }
//!     fn noise(&self, _: &Now, _: &[f64], process: &mut [f64], measurement: &mut [f64]) {
//!         (process[0], measurement[0]) = (0.01, 0.02);
//!     }
//! }
//!
//! // The measured record: 200 samples, 0.1 s apart; here of a tank with k = 1.5, outside its prior.
//! let u: Vec<f64> = (0..200).map(|k| [0.9, 0.2, 0.6][k / 20 % 3]).collect();
//! let drive = Drive::from_slices(0.1, &[&u])?;
//! let outputs = Tank.simulate(&[1.5], &drive, Noise::new(7, "measured", 0))?;
//! let record = Record::new(drive, outputs)?;
//!
//! let study = Study::of(Tank)?;
//! let fit = study.fit(&[record.clone()])?;
//! assert!((fit.parameters[0].value - 1.5).abs() < 4.0 * fit.parameters[0].std_error);
//!
//! let diagnosis = study.diagnose(&[record])?;
//! assert_eq!(diagnosis.verdict, Verdict::ParameterGap); // k is outside its prior; the equations are right
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | task | module |
//! |---|---|
//! | write a simulator | [`twin`]: [`twin::StateSpace`], [`twin::DigitalTwin`] |
//! | read a simulator's equations from a text | [`equations`] |
//! | use a program in any language, or an FMU | [`external`] |
//! | read and write records | [`record`] |
//! | combine twin, record plan and effects | [`study`] |
//! | fit measured records | [`fit`], [`study::Study::fit`] |
//! | train, save, load, estimate; own features and networks | [`estimator`], [`feature`], [`network`] |
//! | find missing effects | [`diagnose`] |
//! | add effects to a twin | [`effect`] |
//! | filter a record, compute its likelihood | [`likelihood`] |
//! | score estimators and diagnoses | [`evaluate`] |
//! | render results | [`report`] |
//! | run the command line over own twins | [`cli`] |
//! | show progress, stop long work | [`progress`] |
//! | import the usual names | [`prelude`] |
//!
//! The library never prints, never exits and sets no global thread pool. Cargo features: `cli` (command
//! line), `report` (results as JSON, text and pages), `evaluate` (scores of estimators and diagnoses), all three default; `mpi` (ranks of a
//! cluster share work), `fmi` (FMUs as twins), `parquet` (records in Parquet files).
//!
//! Public items, the command line and the schemas of files follow semantic versioning; bits of results do not
//! ([docs/architecture.md](../../../docs/architecture.md#versions)).
//!
//! Method: Lakshminarayanan, Guerrero & Rojas, "Fine-Tuning a Simulation-Driven Estimator".

// The library never prints and never panics on data; tests may.
#![cfg_attr(
    not(test),
    warn(clippy::print_stdout, clippy::print_stderr, clippy::unwrap_used)
)]
// Some functions serve the command line alone.
#![cfg_attr(not(feature = "cli"), allow(dead_code, unused_imports))]

/// Implements `Debug` by name, for types that hold twins, maps or listeners.
macro_rules! debug_by_name {
    ($($type:ident $(<$life:lifetime>)?),+ $(,)?) => {
        $(impl std::fmt::Debug for $type $(<$life>)? {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.debug_struct(stringify!($type)).finish_non_exhaustive()
            }
        })+
    };
}

/// Defines numbers that belong together, each beside its unit and its reason: a struct of them, and its one value.
macro_rules! numbers {
    (
        $(#[$of_struct:meta])*
        $shown:vis const $value_name:ident: $struct_name:ident = {
            $($(#[$of_field:meta])* $field:ident: $kind:ty = $value:expr,)*
        }
    ) => {
        $(#[$of_struct])*
        $shown struct $struct_name {
            $($(#[$of_field])* pub $field: $kind,)*
        }

        $shown const $value_name: $struct_name = $struct_name {
            $($field: $value,)*
        };
    };
}

// Unit tests include examples, which name the crate.
#[cfg(test)]
extern crate self as truetwin;

// Rooms, lowest first; a room uses only what stands above it here (tests/house/layering.rs holds it so).
pub mod setting;

mod math;
mod parallel;
pub mod progress;
pub mod storage;

pub mod record;

pub mod twin;
pub mod twins;

pub mod equations;

pub mod effect;

pub mod likelihood;

pub mod fit;

pub mod feature;
pub mod network;

mod hypothesis;

pub mod study;

pub mod external;

pub mod estimator;

pub mod diagnose;

#[cfg(feature = "evaluate")]
pub mod evaluate;

#[cfg(feature = "report")]
pub mod report;

#[cfg(feature = "cli")]
pub mod cli;

pub mod prelude;

/// Entries for the fuzz tests. Not part of the library's interface.
#[doc(hidden)]
pub mod fuzzing {
    /// Banks.
    pub mod banks {
        pub use crate::estimator::bank::file::{read, write};
        pub use crate::estimator::bank::{Bank, Draws};
        pub use crate::estimator::shards::{BankPlan, ShardedBank, merge, merge_into_file};
        pub use crate::storage::work::Share;
    }
    /// Model descriptions of FMUs.
    #[cfg(feature = "fmi")]
    pub mod fmus {
        pub use crate::external::fmu::fuzzing::*;
    }
    /// Lines of programs.
    pub mod programs {
        pub use crate::external::program::fuzzing::*;
    }
    /// Calls of the command line.
    #[cfg(feature = "cli")]
    pub mod calls {
        pub use crate::cli::fuzzing::*;
    }
    /// Runs of evaluations.
    #[cfg(feature = "evaluate")]
    pub mod runs {
        pub use crate::evaluate::fuzzing::*;
    }
    /// Work folders.
    pub mod work {
        use crate::storage::{StorageError, work::WorkFolder};

        /// Reads the manifest of a folder that `verb` is said to have made.
        pub fn manifest(folder: &std::path::Path, verb: &'static str) -> Result<(), StorageError> {
            WorkFolder::find(folder, verb).map(|_| ())
        }
    }
}

#[cfg(doctest)]
mod book;
