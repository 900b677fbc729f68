//! Line charts, bars and heat maps as SVG.
//!
//! Drawn here, in as few bytes as a page of a dozen pictures needs: text in the reader's own font, colours that colour-blind
//! people can tell apart (Okabe & Ito), dashes beside colours, a scale that follows the width of the page, words for screen
//! readers. A plotting crate would bring its own layout, and none of these.
//!
//! | file | holds |
//! |---|---|
//! | `canvas.rs` | the picture that is drawn on, its sizes and its text |
//! | `axis.rs` | ticks and the horizontal axis |
//! | `panel.rs` | what a panel shows: lines, bands, points, marks, stretches |
//! | `lines.rs`, `bars.rs`, `heat.rs`, `pairs.rs` | the kinds of pictures |

mod axis;
mod bars;
mod canvas;
mod heat;
mod lines;
mod pairs;
mod panel;
#[cfg(test)]
mod tests;

pub use bars::{Bar, BarGroup, bar_chart};
pub(super) use canvas::escaped;
pub use heat::{HeatGroup, HeatRow, heat_map};
pub use lines::chart;
pub use pairs::pair_plot;
pub use panel::{Area, Dot, Dots, Line, Panel, Span, Style, TimeMark, roomy};
