//! Layers of a panel below and above its lines: bands, points with intervals, marks.

use super::frame::Frame;
use super::frame::TEXT;
use super::style::Style;
use super::text::{text, width};
use std::fmt::Write;

/// Half the width of a whisker's end.
const CAP: f64 = 4.0;

/// A band between two lines.
#[derive(Debug, Clone, PartialEq)]
pub struct Area {
    /// Name in the legend; empty for none.
    pub label: String,
    /// (x, low, high), sorted by x.
    pub points: Vec<(f64, f64, f64)>,
}

impl Area {
    pub(super) fn draw(&self, out: &mut String, frame: &Frame, y: &impl Fn(f64) -> f64) {
        let finite = || (self.points.iter()).filter(|(_, low, high)| (low + high).is_finite());
        let mut path = String::new();
        for (i, (x, _, high)) in finite().enumerate() {
            let pen = if i == 0 { 'M' } else { 'L' };
            let _ = write!(path, "{pen}{:.1} {:.1}", frame.x(*x), y(*high));
        }
        for (x, low, _) in finite().rev() {
            let _ = write!(path, "L{:.1} {:.1}", frame.x(*x), y(*low));
        }
        if !path.is_empty() {
            let _ = writeln!(
                out,
                r##"<path d="{path}Z" fill="#0072b2" fill-opacity="0.2"/>"##
            );
        }
    }
}

/// Points with their intervals.
#[derive(Debug, Clone, PartialEq)]
pub struct Dots {
    /// Name in the legend; empty for none.
    pub label: String,
    /// Ordered from left to right.
    pub points: Vec<Dot>,
}

/// A point and the ends of its interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dot {
    /// Across.
    pub x: f64,
    /// Up.
    pub y: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Dots {
    pub(super) fn draw(&self, out: &mut String, frame: &Frame, y: &impl Fn(f64) -> f64) {
        let finite = (self.points.iter()).filter(|d| (d.x + d.y + d.low + d.high).is_finite());
        for dot in finite {
            let (x, at) = (frame.x(dot.x), y(dot.y));
            let (low, high) = (y(dot.low), y(dot.high));
            let (left, right) = (x - CAP, x + CAP);
            let _ = writeln!(
                out,
                r##"<path d="M{left:.1} {low:.1}H{right:.1}M{x:.1} {low:.1}V{high:.1}M{left:.1} {high:.1}H{right:.1}" fill="none" stroke="#222222" stroke-width="1.5"/><circle cx="{x:.1}" cy="{at:.1}" r="4.5" fill="#0072b2" stroke="#ffffff"/>"##
            );
        }
    }
}

/// A place on the x axis: a dashed line over the whole height, with its name beside it.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark {
    /// Position.
    pub x: f64,
    /// Its name.
    pub label: String,
}

impl Mark {
    /// Draws the mark between two heights; its name stands at the upper end, on the side with room.
    pub(super) fn draw(&self, out: &mut String, frame: &Frame, (top, bottom): (f64, f64)) {
        let x = frame.x(self.x);
        let _ = writeln!(
            out,
            r##"<path d="M{x:.1} {top:.1}V{bottom:.1}" stroke="#222222" stroke-width="1.5" stroke-dasharray="2 3"/>"##
        );
        let (at, anchor) = if x + width(&self.label, TEXT) + 6.0 <= frame.right {
            (x + 5.0, "start")
        } else {
            (x - 5.0, "end")
        };
        let at = (at, top + TEXT);
        text(out, at, anchor, TEXT, false, &self.label);
    }
}

/// Symbol before a name in the legend.
pub(super) enum Swatch {
    Line(Style),
    Area,
    Dot,
}

impl Swatch {
    /// Draws the symbol from (x, y) on.
    pub(super) fn draw(&self, out: &mut String, (x, y): (f64, f64), long: f64) {
        let end = x + long;
        let _ = match self {
            Self::Line(style) => writeln!(
                out,
                r#"<path d="M{x:.1} {y:.1}H{end:.1}" fill="none" {}/>"#,
                style.stroke()
            ),
            Self::Area => writeln!(
                out,
                r##"<rect x="{x:.1}" y="{:.1}" width="{long}" height="10" fill="#0072b2" fill-opacity="0.2"/>"##,
                y - 5.0
            ),
            Self::Dot => {
                let middle = 0.5 * (x + end);
                writeln!(
                    out,
                    r##"<path d="M{middle:.1} {:.1}V{:.1}" stroke="#222222" stroke-width="1.5"/><circle cx="{middle:.1}" cy="{y:.1}" r="4.5" fill="#0072b2" stroke="#ffffff"/>"##,
                    y - 8.0,
                    y + 8.0
                )
            }
        };
    }
}
