//! Heat maps: rows of stretches of time.

use super::axis::{Across, Ticks, padded};
use super::canvas::{AXIS, BOLD, Canvas, EDGE, GAP, LINE, ROOM, TEXT, WIDTH, clipped, width};
use super::panel::{Span, TimeMark};

/// Height of a row and of the cells inside it.
const ROW: f64 = 30.0;
const CELL: f64 = 26.0;
/// Most room for names.
const NAMES: f64 = 0.34 * ROOM;

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
    pub mark: Option<TimeMark>,
}

/// Groups of rows from top to bottom, along one axis of time.
pub fn heat_map(title: &str, description: &str, groups: &[HeatGroup]) -> String {
    let rows = || groups.iter().flat_map(|group| &group.rows);
    let ends = (rows().flat_map(|row| &row.cells)).flat_map(|cell| [cell.from, cell.to]);
    let range = padded(ends, 0.0);
    let ticks = Ticks::new(range, 5);
    let names = (rows().map(|row| width(&row.label, TEXT))).fold(0.0, f64::max);
    let across = Across {
        range,
        left: EDGE + names.min(NAMES) + GAP,
        right: WIDTH - EDGE.max(ticks.widest() / 2.0 + 4.0),
        ticks,
    };
    let (mut canvas, top) = Canvas::new(title, description);
    let mut y = top + 4.0;
    for group in groups {
        y = group.draw(&mut canvas, &across, y);
    }
    let (left, right) = (across.left, across.right);
    canvas.horizontal((left, right), y, AXIS);
    for (value, label) in across.ticks.labelled() {
        let x = across.x(value);
        canvas.vertical(x, (y, y + 4.0), AXIS);
        canvas.text((x, y + LINE - 1.0), "middle", false, &label);
    }
    let at = (0.5 * (left + right), y + 2.0 * LINE);
    canvas.text(at, "middle", false, "t in s");
    canvas.svg(y + 2.0 * LINE + EDGE)
}

impl HeatGroup {
    /// Draws below `top`; returns where it ends.
    fn draw(&self, canvas: &mut Canvas, across: &Across, top: f64) -> f64 {
        let mut y = top;
        if !self.label.is_empty() {
            let label = clipped(&self.label, TEXT * BOLD, ROOM);
            canvas.text((EDGE, y + LINE - 4.0), "start", true, &label);
            y += LINE + 2.0;
        }
        for row in &self.rows {
            let head = y;
            if row.mark.is_some() {
                // Its name stands above the cells.
                y += LINE;
            }
            let at = (across.left - GAP, y + 0.5 * CELL + 0.35 * TEXT);
            canvas.text(at, "end", false, &clipped(&row.label, TEXT, NAMES));
            for cell in &row.cells {
                cell.draw(canvas, across, y, CELL);
            }
            if let Some(mark) = &row.mark {
                // Down to the cells, not through their text.
                mark.draw(canvas, across, (head, y));
            }
            y += ROW;
        }
        y + 4.0
    }
}
