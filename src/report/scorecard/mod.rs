//! Scores of withheld trials as JSON, text and page.

mod figures;
mod html;
mod json;
mod text;

pub(super) use html::scorecard_html;
pub use json::scorecard_json;
pub use text::scorecard_text;
