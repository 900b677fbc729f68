//! Small multiples: what a quantity is, on average, in ranges of several variables.

use super::frame::Frame;
use super::frame::{EDGE, LINE, ROOM, TEXT, WIDTH, widest};
use super::picture::Picture;
use super::text::{BOLD, clipped, text, width};
use super::ticks::{Ticks, padded};
use crate::report::digits::short;
use std::fmt::Write;

/// Height of the axes.
const HEIGHT: f64 = 96.0;
/// Facets beside each other.
const ACROSS: usize = 3;
/// Between facets.
const GAP: f64 = 18.0;

/// Rows of facets; each row has its own quantity and y axis, each facet its own x axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Multiples {
    /// Heading, also for screen readers.
    pub title: String,
    /// Description for screen readers.
    pub description: String,
    /// Ordered from top to bottom.
    pub rows: Vec<FacetRow>,
}

/// One quantity.
#[derive(Debug, Clone, PartialEq)]
pub struct FacetRow {
    /// Its name, unit and whatever else is to stand in the heading.
    pub label: String,
    /// Heading in bold.
    pub clear: bool,
    /// Ordered from left to right, three in a row.
    pub facets: Vec<Facet>,
}

/// The quantity against one variable.
#[derive(Debug, Clone, PartialEq)]
pub struct Facet {
    /// Variable and unit.
    pub x: String,
    /// Ordered from left to right.
    pub steps: Vec<Step>,
}

/// A mean over a range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Mean of the quantity there.
    pub mean: f64,
    /// Standard error of the mean.
    pub error: f64,
}

impl Step {
    /// The mean is more than two standard errors from zero.
    fn is_clear(&self) -> bool {
        self.mean.abs() > 2.0 * self.error
    }

    fn is_finite(&self) -> bool {
        (self.low + self.high + self.mean + self.error).is_finite()
    }
}

impl Multiples {
    /// The picture, to stand in a file or inside a page.
    pub fn svg(&self) -> String {
        let mut picture = Picture::new(&self.title, &self.description);
        let mut y = picture.top() + 4.0;
        for row in &self.rows {
            y = row.draw(picture.body(), y);
        }
        picture.svg(y + EDGE)
    }
}

impl FacetRow {
    /// Draws below `top`; returns where it ends.
    fn draw(&self, out: &mut String, top: f64) -> f64 {
        let label = clipped(&self.label, TEXT * BOLD, ROOM);
        let at = (EDGE, top + LINE - 4.0);
        text(out, at, "start", TEXT, self.clear, &label);
        let mut y = top + LINE + 4.0;
        let steps = (self.facets.iter().flat_map(|f| &f.steps)).filter(|s| s.is_finite());
        let range = steps.fold((0.0_f64, 0.0_f64), |(low, high), s| {
            (low.min(s.mean - s.error), high.max(s.mean + s.error))
        });
        let range = padded([range.0, range.1].into_iter(), 0.05);
        let ticks = Ticks::new(range, 3);
        let left = EDGE + widest(&ticks) + 8.0;
        let across = self.facets.len().clamp(1, ACROSS);
        let each = (WIDTH - EDGE - left - GAP * (across - 1) as f64) / across as f64;
        for line in self.facets.chunks(ACROSS) {
            for (value, label) in ticks.labelled() {
                let at = (left - 6.0, height(range, y, value) + 0.35 * TEXT);
                text(out, at, "end", TEXT, false, &label);
            }
            for (j, facet) in line.iter().enumerate() {
                let from = left + (each + GAP) * j as f64;
                facet.draw(out, (from, from + each), y, range, &ticks);
            }
            y += HEIGHT + 2.0 * LINE + 6.0;
        }
        y
    }
}

/// Returns the position of a value in axes below `top`.
fn height((low, high): (f64, f64), top: f64, value: f64) -> f64 {
    top + HEIGHT * (high - value) / (high - low)
}

impl Facet {
    fn draw(
        &self,
        out: &mut String,
        (left, right): (f64, f64),
        top: f64,
        range: (f64, f64),
        ticks: &Ticks,
    ) {
        let y = |value: f64| height(range, top, value);
        let bottom = top + HEIGHT;
        for (value, _) in ticks.labelled() {
            let colour = if value == 0.0 { "#555555" } else { "#e4e4e4" };
            let _ = writeln!(
                out,
                r#"<path d="M{left:.1} {:.1}H{right:.1}" stroke="{colour}"/>"#,
                y(value)
            );
        }
        let _ = writeln!(
            out,
            r##"<path d="M{left:.1} {top:.1}V{bottom:.1}H{right:.1}" fill="none" stroke="#555555"/>"##
        );
        let steps = || self.steps.iter().filter(|s| s.is_finite());
        let x = padded(steps().flat_map(|s| [s.low, s.high]), 0.0);
        let frame = Frame {
            x,
            left,
            right,
            ticks: Ticks::new(x, 2),
            columns: 1,
        };
        for step in steps() {
            let (from, to) = (frame.x(step.low) + 1.0, frame.x(step.high) - 1.0);
            let (high, low) = (y(step.mean + step.error), y(step.mean - step.error));
            let (mean, thick) = (y(step.mean), if step.is_clear() { 4.0 } else { 1.5 });
            let _ = writeln!(
                out,
                r##"<rect x="{from:.1}" y="{high:.1}" width="{:.1}" height="{:.1}" fill="#0072b2" fill-opacity="0.2"/><path d="M{from:.1} {mean:.1}H{to:.1}" stroke="#0072b2" stroke-width="{thick}"/>"##,
                (to - from).max(0.0),
                (low - high).max(0.0),
            );
        }
        let room = right - left;
        let ends = [(x.0, left, "start"), (x.1, right, "end")];
        let labels = ends.map(|(value, at, anchor)| (short(value), at, anchor));
        if labels.iter().map(|l| width(&l.0, TEXT)).sum::<f64>() + 6.0 < room {
            for (label, at, anchor) in &labels {
                let at = (*at, bottom + LINE - 3.0);
                text(out, at, anchor, TEXT, false, label);
            }
        }
        let at = (0.5 * (left + right), bottom + 2.0 * LINE - 5.0);
        text(
            out,
            at,
            "middle",
            TEXT,
            false,
            &clipped(&self.x, TEXT, room),
        );
    }
}
