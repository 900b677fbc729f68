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
