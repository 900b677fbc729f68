//! Heat maps: rows of stretches along one x axis.

use super::frame::Frame;
use super::frame::{EDGE, LINE, ROOM, TEXT, WIDTH, widest};
use super::layers::Mark;
use super::picture::Picture;
use super::strip::Span;
use super::text::{BOLD, clipped, text, width};
use super::ticks::{Ticks, padded};
use std::fmt::Write;

/// Height of a row and of the cells inside it.
const ROW: f64 = 30.0;
const CELL: f64 = 26.0;
/// Between names and cells.
const GAP: f64 = 8.0;
/// Most room for names.
const NAMES: f64 = 0.34 * ROOM;

/// Groups of rows above each other along one x axis.
#[derive(Debug, Clone, PartialEq)]
pub struct HeatMap {
    /// Heading, also for screen readers.
    pub title: String,
    /// Description for screen readers.
    pub description: String,
    /// Quantity and unit of the x axis.
    pub x: String,
    /// Ordered from top to bottom.
    pub groups: Vec<HeatGroup>,
}

/// Rows under a heading.
#[derive(Debug, Clone, PartialEq)]
pub struct HeatGroup {
    /// Heading; empty for none.
    pub label: String,
    /// Ordered from top to bottom.
    pub rows: Vec<HeatRow>,
}

/// One row of cells.
#[derive(Debug, Clone, PartialEq)]
pub struct HeatRow {
    /// Name.
    pub label: String,
    /// Ordered from left to right.
    pub cells: Vec<Span>,
    /// A place on the x axis.
    pub mark: Option<Mark>,
}

impl HeatMap {
    /// The picture, to stand in a file or inside a page.
    pub fn svg(&self) -> String {
        let rows = || self.groups.iter().flat_map(|group| &group.rows);
        let ends = (rows().flat_map(|row| &row.cells)).flat_map(|cell| [cell.from, cell.to]);
        let x = padded(ends, 0.0);
        let ticks = Ticks::new(x, 5);
        let names = (rows().map(|row| width(&row.label, TEXT))).fold(0.0, f64::max);
        let frame = Frame {
            x,
            left: EDGE + names.min(NAMES) + GAP,
            right: WIDTH - EDGE.max(widest(&ticks) / 2.0 + 4.0),
            ticks,
            columns: 1,
        };
        let mut picture = Picture::new(&self.title, &self.description);
        let mut y = picture.top() + 4.0;
        for group in &self.groups {
            y = group.draw(picture.body(), &frame, y);
        }
        self.axis(picture.body(), &frame, y);
        picture.svg(y + 2.0 * LINE + EDGE)
    }

    /// Ticks below everything, and what they are.
    fn axis(&self, out: &mut String, frame: &Frame, y: f64) {
        let (left, right) = (frame.left, frame.right);
        let _ = writeln!(
            out,
            r##"<path d="M{left:.1} {y:.1}H{right:.1}" stroke="#555555"/>"##
        );
        for (value, label) in frame.ticks.labelled() {
            let (x, end) = (frame.x(value), y + 4.0);
            let _ = writeln!(
                out,
                r##"<path d="M{x:.1} {y:.1}V{end:.1}" stroke="#555555"/>"##
            );
            text(out, (x, y + LINE - 1.0), "middle", TEXT, false, &label);
        }
        let at = (0.5 * (left + right), y + 2.0 * LINE);
        text(
            out,
            at,
            "middle",
            TEXT,
            false,
            &clipped(&self.x, TEXT, ROOM),
        );
    }
}

impl HeatGroup {
    /// Draws below `top`; returns where it ends.
    fn draw(&self, out: &mut String, frame: &Frame, top: f64) -> f64 {
        let mut y = top;
        if !self.label.is_empty() {
            let label = clipped(&self.label, TEXT * BOLD, ROOM);
            text(out, (EDGE, y + LINE - 4.0), "start", TEXT, true, &label);
            y += LINE + 2.0;
        }
        for row in &self.rows {
            let head = y;
            if row.mark.is_some() {
                // Its name stands above the cells.
                y += LINE;
            }
            let label = clipped(&row.label, TEXT, NAMES);
            let at = (frame.left - GAP, y + 0.5 * CELL + 0.35 * TEXT);
            text(out, at, "end", TEXT, false, &label);
            for cell in &row.cells {
                cell.draw(out, frame, y, CELL);
            }
            if let Some(mark) = &row.mark {
                // Down to the cells, not through their text.
                mark.draw(out, frame, (head, y));
            }
            y += ROW;
        }
        y + 4.0
    }
}
