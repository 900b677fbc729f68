//! Line charts: panels above each other along one x axis, or each along its own.

use super::axes::Axes;
use super::frame::{EDGE, Frame, LINE, POINTS, TEXT, WIDTH, widest};
use super::panel::Panel;
use super::picture::Picture;
use super::text::{clipped, text};
use super::ticks::{Ticks, padded};

/// Panels above each other along one x axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Heading, also for screen readers.
    pub title: String,
    /// Description for screen readers.
    pub description: String,
    /// Quantity and unit of the x axis.
    pub x: String,
    /// Ordered from top to bottom.
    pub panels: Vec<Panel>,
}

/// Panels above each other, each along its own x axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Curves {
    /// Heading, also for screen readers.
    pub title: String,
    /// Description for screen readers.
    pub description: String,
    /// Quantity and unit of each x axis, and what is drawn over it; ordered from top to bottom.
    pub panels: Vec<(String, Panel)>,
}

impl Chart {
    /// The picture, to stand in a file or inside a page.
    pub fn svg(&self) -> String {
        let mut picture = Picture::new(&self.title, &self.description);
        let top = picture.top();
        let end = draw(picture.body(), &self.x, &self.panels, top);
        picture.svg(end + EDGE)
    }
}

impl Curves {
    /// The picture, to stand in a file or inside a page.
    pub fn svg(&self) -> String {
        let mut picture = Picture::new(&self.title, &self.description);
        let mut y = picture.top();
        for (x, panel) in &self.panels {
            y = draw(picture.body(), x, std::slice::from_ref(panel), y) + EDGE;
        }
        picture.svg(y)
    }
}

/// Draws panels along one x axis below `top`; returns the last baseline.
fn draw(out: &mut String, x_axis: &str, panels: &[Panel], top: f64) -> f64 {
    let points = panels.iter().flat_map(Panel::points);
    // A point on an axis would be cut in half.
    let dotted = panels.iter().any(|p| !p.dots.is_empty());
    let x = padded(points.map(|p| p.0), if dotted { 0.05 } else { 0.0 });
    let ticks = Ticks::new(x, 5);
    // The last label may stand under the end of the axis.
    let outermost = widest(&ticks);
    let lines = panels.iter().map(|p| p.series.len()).sum::<usize>();
    let all: Vec<Axes<'_>> = panels.iter().map(Axes::new).collect();
    let frame = Frame {
        x,
        left: all.iter().map(Axes::margin).fold(0.0, f64::max),
        right: WIDTH - EDGE.max(outermost / 2.0 + 4.0),
        ticks,
        columns: (POINTS / 2 / lines.max(1)).clamp(1, WIDTH as usize),
    };
    let mut y = top;
    for (i, axes) in all.iter().enumerate() {
        y = axes.draw(out, &frame, y + 4.0, i + 1 == all.len());
    }
    y += 2.0 * LINE - 2.0;
    let middle = 0.5 * (frame.left + frame.right);
    let room = 2.0 * (WIDTH - EDGE - middle).min(middle - EDGE);
    let label = clipped(x_axis, TEXT, room);
    text(out, (middle, y), "middle", TEXT, false, &label);
    y
}
