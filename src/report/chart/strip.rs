//! Stretches of the x axis, marked in a strip below it.

use super::frame::Frame;
use super::frame::TEXT;
use super::text::{BOLD, text, width};
use std::fmt::Write;

/// Height of the strip, and its distance from the axis.
const HEIGHT: f64 = 22.0;
const GAP: f64 = 5.0;
/// Opacity of a stretch of full weight: text on it must stay legible.
const DENSEST: f64 = 0.55;

/// A stretch of the x axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Span {
    /// Start.
    pub from: f64,
    /// End.
    pub to: f64,
    /// Label inside, if there is room.
    pub label: String,
    /// Darkness, 0 to 1.
    pub weight: f64,
    /// Framed, with bold text; otherwise bare.
    pub clear: bool,
}

impl Span {
    /// Draws a cell so high below `top`.
    pub(super) fn draw(&self, out: &mut String, frame: &Frame, top: f64, height: f64) {
        let (from, to) = (frame.x(self.from) + 1.0, frame.x(self.to) - 1.0);
        let opacity = DENSEST * self.weight.clamp(0.0, 1.0);
        let (stroke, bold) = match self.clear {
            true => (r##" stroke="#222222""##, BOLD),
            false => ("", 1.0),
        };
        let _ = writeln!(
            out,
            r##"<rect x="{from:.1}" y="{top:.1}" width="{:.1}" height="{height}" fill="#d55e00" fill-opacity="{opacity:.2}"{stroke}/>"##,
            (to - from).max(0.0)
        );
        if width(&self.label, TEXT * bold) <= to - from {
            let at = (0.5 * (from + to), top + 0.5 * height + 0.35 * TEXT);
            text(out, at, "middle", TEXT, self.clear, &self.label);
        }
    }
}

/// Room that the strip takes below the axis.
pub(super) fn height(spans: &[Span]) -> f64 {
    if spans.is_empty() { 0.0 } else { GAP + HEIGHT }
}

/// Draws the strip below an axis at `bottom`.
pub(super) fn draw(out: &mut String, frame: &Frame, spans: &[Span], bottom: f64) {
    for span in spans {
        span.draw(out, frame, bottom + GAP, HEIGHT);
    }
}
