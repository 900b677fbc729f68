//! What people and other programs read: JSON, text on the terminal, pictures. Renders, computes nothing.
//!
//! | to … | call |
//! |---|---|
//! | hand an estimate to another program | [`estimate_json`] |
//! | show an estimate on the terminal | [`estimate_text`] |
//! | see the twin beside the record | [`overlay_svg`] |
//! | draw any other lines | [`chart`] |

pub mod chart;
mod digits;
mod estimate_json;
mod estimate_text;
#[cfg(test)]
mod fixture;
mod overlay;
mod trajectories;

pub use estimate_json::estimate_json;
pub use estimate_text::estimate_text;
pub use overlay::overlay_svg;
pub use trajectories::trajectories_csv;
