//! Scores over many records as JSON, tables and figures.

mod figures;
mod scores;
#[cfg(test)]
mod tests;

pub use figures::{coverage_svg, first_run_svg, mean_runs_svg};
pub use scores::{reproduce_json, reproduce_text};
