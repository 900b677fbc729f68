//! What people and other programs read: JSON, text on the terminal, pictures. Renders, computes nothing.
//!
//! | to … | call |
//! |---|---|
//! | hand an estimate to another program | [`estimate_json`] |
//! | show an estimate on the terminal | [`estimate_text`] |
//! | hand on, or show, what a twin lacks | [`gap_json`], [`gap_text`], [`gap_html`] |
//! | draw where a twin lacks something | [`gap_runs_svg`], [`gap_time_svg`], [`gap_equations_svg`], [`gap_targets_svg`], [`gap_regions_svg`], [`gap_channels_svg`], [`gap_lags_svg`], [`gap_bands_svg`] |
//! | draw what, how far, and what next | [`gap_which_svg`], [`gap_shrinkage_svg`], [`gap_terms_svg`], [`gap_missing_svg`], [`gap_next_input_svg`] |
//! | see the twin beside the record | [`overlay_svg`] |
//! | hand on, print or draw the scores of many records | [`reproduce_json`], [`reproduce_text`], [`mean_runs_svg`], [`first_run_svg`] |
//! | hand on, print or show the scores of withheld trials | [`scorecard_json`], [`scorecard_text`], [`scorecard_html`] |
//!
//! ```
//! use truetwin::diagnose::{DiagnoseSettings, diagnose};
//! use truetwin::progress::Progress;
//! use truetwin::report::*;
//! use truetwin::study::{RecordPlan, Study};
//! use truetwin::effect::*;
//! use truetwin::record::*;
//! use truetwin::twin::*;
//! use truetwin::twins::VanDerPol;
//!
//! let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 200))?;
//! let drive = Drive::autonomous(0.05, 200)?;
//! let outputs = VanDerPol.simulate(&[1.5], &drive, Noise::new(7, "measured", 0))?;
//! let record = Record::new(drive, outputs)?;
//! let found = diagnose(&study, &[record], None, &DiagnoseSettings::default(), &Progress::silent())?;
//!
//! assert_eq!(gap_json(&found)["schema"], "truetwin.gap/1");
//! assert!(gap_text(&found).starts_with("No gap"));
//! assert!(gap_html(&study, &found).starts_with("<!doctype html>"));
//! // Pictures: each where there is something to show.
//! let pictures = [
//!     gap_runs_svg(&study, &found, false), gap_time_svg(&found), gap_equations_svg(&study, &found),
//!     gap_targets_svg(&found), gap_regions_svg(&study, &found), gap_channels_svg(&study, &found),
//!     gap_lags_svg(&found), gap_bands_svg(&found), gap_which_svg(&found), gap_shrinkage_svg(&found),
//!     gap_terms_svg(&study, &found), gap_missing_svg(&study, &found), gap_next_input_svg(&study, &found),
//! ];
//! assert!(pictures[0].is_some());
//! assert!(pictures.iter().flatten().all(|svg| svg.starts_with("<svg")));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! ```
//! use truetwin::evaluate::paper::{Benchmark, FreeRuns, MeanRuns, MonteCarlo, Scenario, reference_studies, score};
//! use truetwin::progress::Progress;
//! use truetwin::report::*;
//! use truetwin::estimator::{EstimateOptions, PretrainOptions, pretrain};
//!
//! let study = &reference_studies()?[0];
//! let small = PretrainOptions { bank_size: Some(200), epochs: Some(2), ..PretrainOptions::default() };
//! let (estimator, _) = pretrain(study, &small, &Progress::silent())?;
//! let record = study.demo().ok_or("a record comes with it")?;
//! let estimate = estimator.estimate(record, &EstimateOptions::default(), &Progress::silent())?;
//! assert_eq!(estimate_json(study, &estimate)["schema"], "truetwin.estimate/1");
//! assert!(estimate_text(study, &estimate).contains("nu"));
//! let after = &estimate.tracking.as_ref().ok_or("the free run is finite")?.outputs;
//! assert!(overlay_svg(study, record, None, after).starts_with("<svg"));
//! assert!(trajectories_csv(record, None, after).starts_with("t,"));
//!
//! // Many records.
//! let plan = MonteCarlo { benchmark: Benchmark::of(study), scenario: Scenario::First, runs: 1, seed: 1 };
//! let runs = plan.run(&estimator, None, &Progress::silent())?;
//! let scores = score(study, &plan, &runs);
//! assert_eq!(reproduce_json(study, &plan, estimator.preset(), &scores)["schema"], "truetwin.reproduce/1");
//! assert!(reproduce_text(study, &plan, estimator.preset(), &scores).contains("TS-fine"));
//! assert!(first_run_svg(study, &FreeRuns::of(study, &plan, &runs[0])?).starts_with("<svg"));
//! let means = MeanRuns::of(study, &plan, &runs)?.ok_or("all records have the same truth")?;
//! assert!(mean_runs_svg(study, &means).is_some());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! ```
//! use truetwin::report::{scorecard_html, scorecard_json, scorecard_text};
//! use truetwin::evaluate::trials::Scorecard;
//!
//! let card = Scorecard::new("tanks", 1, 0.05, "0f1e", vec![]); // of no trial yet
//! assert_eq!(scorecard_json(&card)["schema"], "truetwin.scorecard/1");
//! assert!(scorecard_text(&card).starts_with("tanks: 0 withheld trials"));
//! assert!(scorecard_html(&card).contains("Reliability"));
//! ```

mod chart;
mod digits;
mod estimate_json;
mod estimate_text;
#[cfg(test)]
mod fixture;
mod gap_figures;
mod gap_html;
mod gap_json;
mod gap_text;
mod overlay;
mod page;
mod reproduce_figures;
mod reproduce_json;
#[cfg(test)]
mod reproduce_tests;
mod reproduce_text;
mod scorecard_figures;
mod scorecard_html;
mod scorecard_json;
mod scorecard_text;
mod table;
mod trajectories;
mod units;

pub use estimate_json::estimate_json;
pub use estimate_text::estimate_text;
pub use gap_figures::{
    gap_bands_svg, gap_channels_svg, gap_equations_svg, gap_lags_svg, gap_missing_svg,
    gap_next_input_svg, gap_regions_svg, gap_runs_svg, gap_shrinkage_svg, gap_targets_svg,
    gap_terms_svg, gap_time_svg, gap_which_svg,
};
pub use gap_html::gap_html;
pub(crate) use gap_json::NEXT_INPUT;
pub use gap_json::gap_json;
pub use gap_text::gap_text;
pub use overlay::overlay_svg;
pub use reproduce_figures::{first_run_svg, mean_runs_svg};
pub use reproduce_json::reproduce_json;
pub use reproduce_text::reproduce_text;
pub use scorecard_html::scorecard_html;
pub use scorecard_json::scorecard_json;
pub use scorecard_text::scorecard_text;
pub use trajectories::trajectories_csv;
