//! Results for people and other programs: JSON, text for the terminal, pictures, pages. Renders; computes nothing.
//!
//! | result of | JSON | text | pictures and pages |
//! |---|---|---|---|
//! | `estimate` | [`Report::json`] | [`Report::text`] | [`Estimate::html`] |
//! | `fit` | [`Report::json`] | [`Report::text`] | [`Fit::html`] |
//! | `diagnose` | [`Report::json`] | [`Report::text`] | [`Diagnosis::html`], [`Diagnosis::pictures`] |
//! | `withheld` | `Scorecard::json` | `Scorecard::text` | `Scorecard::html` |
//!
//! ```
//! use truetwin::diagnose::{DiagnoseSettings, diagnose};
//! use truetwin::prelude::*;
//! use truetwin::report::Report;
//! use truetwin::twins::VanDerPol;
//!
//! let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 200))?;
//! let drive = Drive::autonomous(0.05, 200)?;
//! let outputs = VanDerPol.simulate(&[1.5], &drive, Noise::new(7, "measured", 0))?;
//! let record = Record::new(drive, outputs)?;
//! let settings = DiagnoseSettings { detection_only: true, ..DiagnoseSettings::default() };
//! let diagnosis = diagnose(&study, &[record], None, &settings, &Progress::silent())?;
//!
//! assert_eq!(diagnosis.json(&study)["schema"], "truetwin.gap/2");
//! assert!(diagnosis.text(&study).starts_with("No gap"));
//! assert!(diagnosis.html(&study).starts_with("<!doctype html>"));
//! assert!(diagnosis.pictures(&study).iter().all(|(_, svg)| svg.starts_with("<svg")));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod chart;
mod check;
mod compare;
mod digits;
mod document;
mod estimate;
mod fit;
#[cfg(test)]
mod fixture;
mod gap;
mod parameters;
mod record;
#[cfg(feature = "evaluate")]
mod reproduce;
mod residuals;
#[cfg(feature = "evaluate")]
mod scorecard;
mod units;

pub(crate) use check::check_document;
pub(crate) use compare::{ComparedStudy, compare_document, compare_json, compare_svg};
pub(crate) use document::Document;
pub(crate) use estimate::{together_document, together_json};
pub(crate) use fit::posterior_svg;
pub(crate) use gap::NEXT_INPUT;
pub(crate) use record::{overlay_svg, trajectories_csv};
#[cfg(feature = "evaluate")]
pub(crate) use reproduce::{
    coverage_svg, first_run_svg, mean_runs_svg, reproduce_json, reproduce_text,
};

use crate::diagnose::Diagnosis;
use crate::estimator::Estimate;
use crate::fit::Fit;
use crate::record::Record;
use crate::study::Study;
use serde_json::Value;

/// A result of a study that programs read as JSON and people as text; the [module](self) has an example.
///
/// `tests/contract` has schemas of the JSON. All keys are always there.
pub trait Report {
    /// One JSON object, named by its `schema`; what was skipped or is not finite is null.
    fn json(&self, study: &Study) -> Value;
    /// Lines for the terminal.
    fn text(&self, study: &Study) -> String;
}

impl Report for Estimate {
    fn json(&self, study: &Study) -> Value {
        estimate::estimate_json(study, self)
    }
    fn text(&self, study: &Study) -> String {
        self.document(study, None).text()
    }
}

impl Report for Fit {
    fn json(&self, study: &Study) -> Value {
        fit::fit_json(study, self)
    }
    fn text(&self, study: &Study) -> String {
        self.document(study, &[]).text()
    }
}

impl Report for Diagnosis {
    fn json(&self, _: &Study) -> Value {
        gap::gap_json(self)
    }
    fn text(&self, study: &Study) -> String {
        self.document(study).text()
    }
}

impl Estimate {
    /// Page of its own: record and free run, parameters with prior and bounds, draws, residuals, warnings.
    pub fn html(&self, study: &Study, record: &Record) -> String {
        self.document(study, Some(record)).html()
    }

    pub(crate) fn document(&self, study: &Study, record: Option<&Record>) -> Document {
        estimate::estimate_document(study, record, self)
    }
}

impl Fit {
    /// Page of its own, as [`Estimate::html`]; the records in the order of the fit.
    pub fn html(&self, study: &Study, records: &[Record]) -> String {
        self.document(study, records).html()
    }

    pub(crate) fn document(&self, study: &Study, records: &[Record]) -> Document {
        fit::fit_document(study, records, self)
    }
}

impl Diagnosis {
    /// Self-contained page for screen, phone and print.
    ///
    /// Pictures are SVG inside the page with descriptions for screen readers; colour never carries information alone. The page
    /// has no scripts and loads nothing.
    pub fn html(&self, study: &Study) -> String {
        self.document(study).html()
    }

    pub(crate) fn document(&self, study: &Study) -> Document {
        gap::gap_document(study, self)
    }

    /// Pictures of the page as files of their own: name, SVG.
    pub fn pictures(&self, study: &Study) -> Vec<(&'static str, String)> {
        gap::gap_pictures(study, self)
    }
}
