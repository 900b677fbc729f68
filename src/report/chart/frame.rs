//! Sizes, and the horizontal axis that everything in a picture shares.

use super::text::width;
use super::ticks::Ticks;

/// Width in user units: narrow, so that text is still legible on a phone.
pub(super) const WIDTH: f64 = 520.0;
/// Widest on a page, in CSS pixels.
pub(super) const LARGEST: u32 = 880;
/// Distance of anything from the edge.
pub(super) const EDGE: f64 = 12.0;
/// Font sizes of the title and of everything else, and the height of a line of text.
pub(super) const TITLE: f64 = 17.0;
pub(super) const TEXT: f64 = 14.0;
pub(super) const LINE: f64 = 20.0;
/// Room for a text that has a row to itself.
pub(super) const ROOM: f64 = WIDTH - 2.0 * EDGE;
/// Points of all lines together: keeps a file under 300 KiB.
pub(super) const POINTS: usize = 20_000;

/// The horizontal axis.
pub(super) struct Frame {
    pub(super) x: (f64, f64),
    pub(super) ticks: Ticks,
    pub(super) left: f64,
    pub(super) right: f64,
    /// Number of columns that lines are thinned to.
    pub(super) columns: usize,
}

impl Frame {
    pub(super) fn x(&self, value: f64) -> f64 {
        let share = (value - self.x.0) / (self.x.1 - self.x.0);
        self.left + share * (self.right - self.left)
    }
}

/// Width of the widest label.
pub(super) fn widest(ticks: &Ticks) -> f64 {
    (ticks.labelled())
        .map(|(_, label)| width(&label, TEXT))
        .fold(0.0, f64::max)
}
