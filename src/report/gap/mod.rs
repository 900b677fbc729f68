//! A diagnosis as JSON, text, pictures and page.

mod headline;
mod html;
mod json;
mod pictures;
mod share;
mod step;
mod story;
mod text;
mod words;

pub(super) use html::gap_html;
pub(crate) use json::NEXT_INPUT;
pub(super) use json::gap_json;
pub(super) use pictures::gap_pictures;
pub(super) use text::gap_text;

#[cfg(test)]
mod tests;
