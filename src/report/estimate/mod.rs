//! An estimate as JSON, text, picture and table.

mod json;
mod overlay;
mod text;
mod together;
mod trajectories;

pub(super) use json::estimate_json;
pub(crate) use overlay::overlay_svg;
pub(super) use text::estimate_text;
pub(crate) use together::{together_json, together_text};
pub use trajectories::trajectories_csv;

use super::parameters::ParameterRow;
use crate::estimator::Estimate;
use crate::study::Study;

/// One line of the table a parameter, in the order of θ.
pub(super) fn rows(study: &Study, estimate: &Estimate) -> Vec<ParameterRow> {
    let space = study.twin().parameters();
    let row = |(j, parameter)| {
        let interval = [estimate.low[j], estimate.high[j]];
        let (value, error) = (estimate.theta[j], estimate.std_error[j]);
        ParameterRow {
            leans: estimate.leans_on_prior(),
            ..ParameterRow::new(parameter, value, error, interval)
        }
    };
    space.iter().enumerate().map(row).collect()
}
