//! Scores over many records as JSON, tables and figures.

mod coverage;
mod figures;
mod json;
#[cfg(test)]
mod tests;
mod text;

pub use coverage::coverage_svg;
pub use figures::{first_run_svg, mean_runs_svg};
pub use json::reproduce_json;
pub use text::reproduce_text;
