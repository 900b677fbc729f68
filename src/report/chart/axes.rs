//! One panel: axes, ticks, legend, lines.

use super::decimate::decimate;
use super::frame::{EDGE, Frame, LINE, ROOM, TEXT, WIDTH, widest};
use super::layers::Swatch;
use super::panel::Panel;
use super::strip;
use super::text::{BOLD, clipped, text, width};
use super::ticks::{Ticks, padded};
use std::fmt::Write;

/// Length of a line in the legend, with the gap after it.
pub(super) const SWATCH: f64 = 28.0;

/// Between entries of the legend.
const GAP: f64 = 16.0;

/// A panel with its range and ticks.
pub(super) struct Axes<'a> {
    panel: &'a Panel,
    range: (f64, f64),
    ticks: Ticks,
}

impl<'a> Axes<'a> {
    pub(super) fn new(panel: &'a Panel) -> Self {
        let range = (panel.range).unwrap_or_else(|| padded(panel.points().map(|p| p.1), 0.05));
        Self {
            ticks: Ticks::new(range, (panel.height / 34.0) as usize),
            panel,
            range,
        }
    }

    /// Room for the labels of the ticks.
    pub(super) fn margin(&self) -> f64 {
        EDGE + widest(&self.ticks) + 8.0
    }

    /// Draws below `top`; returns where it ends.
    pub(super) fn draw(&self, out: &mut String, frame: &Frame, top: f64, last: bool) -> f64 {
        let mut top = self.legend(out, top) + 14.0;
        if !self.panel.marks.is_empty() {
            // Their names stand above the lines.
            top += LINE - 6.0;
        }
        let bottom = top + self.panel.height;
        let y = |value: f64| {
            bottom - (value - self.range.0) / (self.range.1 - self.range.0) * self.panel.height
        };
        let (left, right) = (frame.left, frame.right);
        let end = bottom + strip::height(&self.panel.spans);
        for (value, label) in frame.ticks.labelled() {
            let x = frame.x(value);
            let _ = writeln!(
                out,
                r##"<path d="M{x:.1} {top:.1}V{bottom:.1}" stroke="#e4e4e4"/>"##
            );
            if last {
                text(out, (x, end + LINE - 3.0), "middle", TEXT, false, &label);
            }
        }
        for (value, label) in self.ticks.labelled() {
            let y = y(value);
            let colour = if value == 0.0 { "#a8a8a8" } else { "#e4e4e4" };
            let _ = writeln!(
                out,
                r#"<path d="M{left:.1} {y:.1}H{right:.1}" stroke="{colour}"/>"#
            );
            text(
                out,
                (left - 6.0, y + 0.35 * TEXT),
                "end",
                TEXT,
                false,
                &label,
            );
        }
        let _ = writeln!(
            out,
            r##"<path d="M{left:.1} {top:.1}V{bottom:.1}H{right:.1}" fill="none" stroke="#555555"/>"##
        );
        for area in &self.panel.areas {
            area.draw(out, frame, &y);
        }
        for series in &self.panel.series {
            let mut path = String::new();
            let mut pen = 'M';
            for (px, py) in decimate(&series.points, frame.columns) {
                if py.is_finite() {
                    let _ = write!(path, "{pen}{:.1} {:.1}", frame.x(px), y(py));
                    pen = 'L';
                } else {
                    pen = 'M';
                }
            }
            let stroke = series.style.stroke();
            let _ = writeln!(
                out,
                r#"<path d="{path}" fill="none" {stroke} stroke-linejoin="round"/>"#
            );
        }
        for dots in &self.panel.dots {
            dots.draw(out, frame, &y);
        }
        for mark in &self.panel.marks {
            mark.draw(out, frame, (top - LINE, bottom));
        }
        strip::draw(out, frame, &self.panel.spans, bottom);
        end
    }

    /// The quantity, then lines with their labels: beside it, or below in as many rows as they need. Returns the last baseline.
    fn legend(&self, out: &mut String, top: f64) -> f64 {
        let quantity = clipped(&self.panel.y, TEXT * BOLD, ROOM);
        let mut at = (EDGE, top + LINE);
        text(out, at, "start", TEXT, true, &quantity);
        at.0 += width(&quantity, TEXT * BOLD) + GAP;
        let entries: Vec<(String, f64, Swatch)> = (legend(self.panel))
            .map(|(label, swatch)| {
                let label = clipped(label, TEXT, ROOM - SWATCH);
                (label.clone(), SWATCH + width(&label, TEXT), swatch)
            })
            .collect();
        let all: f64 = entries.iter().map(|(_, needs, _)| needs + GAP).sum();
        if at.0 + all - GAP > WIDTH - EDGE && !entries.is_empty() {
            at = (EDGE, at.1 + LINE);
        }
        for (label, needs, swatch) in entries {
            if at.0 > EDGE && at.0 + needs > WIDTH - EDGE {
                at = (EDGE, at.1 + LINE);
            }
            swatch.draw(out, (at.0, at.1 - 0.35 * TEXT), SWATCH - 6.0);
            text(out, (at.0 + SWATCH, at.1), "start", TEXT, false, &label);
            at.0 += needs + GAP;
        }
        at.1
    }
}

/// Returns all named layers, lines first.
fn legend(panel: &Panel) -> impl Iterator<Item = (&str, Swatch)> {
    let lines = (panel.series.iter()).map(|s| (s.label.as_str(), Swatch::Line(s.style)));
    let areas = (panel.areas.iter()).map(|a| (a.label.as_str(), Swatch::Area));
    let dots = (panel.dots.iter()).map(|d| (d.label.as_str(), Swatch::Dot));
    (lines.chain(areas).chain(dots)).filter(|(label, _)| !label.is_empty())
}
