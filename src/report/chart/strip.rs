//! Stretches of the x axis, marked in a strip below it.

use super::TEXT;
use super::axes::Frame;
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
    /// Where it begins.
    pub from: f64,
    /// Where it ends.
    pub to: f64,
    /// Written inside where there is room.
    pub label: String,
    /// From 0 to 1: how dark it is.
    pub weight: f64,
    /// An unbroken frame and bold text; otherwise the frame is dashed.
    pub clear: bool,
}

/// Room that the strip takes below the axis.
pub(super) fn height(spans: &[Span]) -> f64 {
    match spans.is_empty() {
        true => 0.0,
        false => GAP + HEIGHT,
    }
}

/// Draws the strip below an axis at `bottom`.
pub(super) fn draw(out: &mut String, frame: &Frame, spans: &[Span], bottom: f64) {
    let top = bottom + GAP;
    for span in spans {
        let (from, to) = (frame.x(span.from) + 1.0, frame.x(span.to) - 1.0);
        let opacity = DENSEST * span.weight.clamp(0.0, 1.0);
        let dash = if span.clear {
            ""
        } else {
            r#" stroke-dasharray="3 3""#
        };
        let _ = writeln!(
            out,
            r##"<rect x="{from:.1}" y="{top:.1}" width="{:.1}" height="{HEIGHT}" fill="#d55e00" fill-opacity="{opacity:.2}" stroke="#222222"{dash}/>"##,
            (to - from).max(0.0)
        );
        let bold = if span.clear { BOLD } else { 1.0 };
        if width(&span.label, TEXT * bold) <= to - from {
            let at = (0.5 * (from + to), top + 0.5 * HEIGHT + 0.35 * TEXT);
            text(out, at, "middle", TEXT, span.clear, &span.label);
        }
    }
}
