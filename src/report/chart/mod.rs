//! Line charts, bars and heat maps as SVG.
//!
//! Drawn here, in as few bytes as a page of a dozen pictures needs: text in the reader's own font, colours that colour-blind
//! people can tell apart (Okabe & Ito), dashes beside colours, a scale that follows the width of the page, words for screen
//! readers. A plotting crate would bring its own layout, and none of these.

mod axes;
mod bars;
mod decimate;
mod frame;
mod heat;
mod layers;
mod lines;
mod pairs;
mod panel;
mod picture;
mod strip;
mod style;
#[cfg(test)]
mod tests;
mod text;
mod ticks;

pub use bars::{Bar, BarChart, BarGroup};
pub use heat::{HeatGroup, HeatMap, HeatRow};
pub use layers::{Area, Dot, Dots, Mark};
pub use lines::{Chart, Curves};
pub use pairs::Pairs;
pub use panel::{Panel, Series, roomy};
pub use strip::Span;
pub use style::Style;
pub(super) use text::escaped;
