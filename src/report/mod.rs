//! Results for people and other programs: JSON, text for the terminal, pictures, pages. Renders; computes nothing.
//!
//! | result of | JSON | text | pictures and pages |
//! |---|---|---|---|
//! | `estimate` | [`estimate_json`] | [`estimate_text`] | [`overlay_svg`] |
//! | `fit` | [`fit_json`] | [`fit_text`] | [`overlay_svg`] |
//! | `diagnose` | [`gap_json`] | [`gap_text`] | [`gap_html`], [`gap_pictures`] |
//! | `withheld` | | | [`scorecard_html`] |
//!
//! ```
//! use truetwin::diagnose::{DiagnoseSettings, diagnose};
//! use truetwin::prelude::*;
//! use truetwin::report::{gap_html, gap_json, gap_pictures, gap_text};
//! use truetwin::twins::VanDerPol;
//!
//! let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 200))?;
//! let drive = Drive::autonomous(0.05, 200)?;
//! let outputs = VanDerPol.simulate(&[1.5], &drive, Noise::new(7, "measured", 0))?;
//! let record = Record::new(drive, outputs)?;
//! let settings = DiagnoseSettings { detection_only: true, ..DiagnoseSettings::default() };
//! let diagnosis = diagnose(&study, &[record], None, &settings, &Progress::silent())?;
//!
//! assert_eq!(gap_json(&diagnosis)["schema"], "truetwin.gap/1");
//! assert!(gap_text(&diagnosis).starts_with("No gap"));
//! assert!(gap_html(&study, &diagnosis).starts_with("<!doctype html>"));
//! assert!(gap_pictures(&study, &diagnosis).iter().all(|(_, svg)| svg.starts_with("<svg")));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod chart;
mod digits;
mod estimate;
mod fit;
#[cfg(test)]
mod fixture;
mod gap;
mod page;
mod reproduce;
mod scorecard;
mod table;
mod units;

pub(crate) use estimate::trajectories_csv;
pub use estimate::{estimate_json, estimate_text, overlay_svg};
pub use fit::{fit_json, fit_text};
pub(crate) use gap::NEXT_INPUT;
pub use gap::{gap_html, gap_json, gap_pictures, gap_text};
pub(crate) use reproduce::{first_run_svg, mean_runs_svg, reproduce_json, reproduce_text};
pub use scorecard::scorecard_html;
pub(crate) use scorecard::{scorecard_json, scorecard_text};
