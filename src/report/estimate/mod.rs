//! An estimate as JSON, text, picture and table.

mod json;
mod overlay;
mod text;
mod trajectories;

pub(super) use json::estimate_json;
pub use overlay::overlay_svg;
pub(super) use text::estimate_text;
pub use trajectories::trajectories_csv;
