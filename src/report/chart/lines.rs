//! Line charts: panels above each other along one x axis.

use super::axes::Axes;
use super::frame::{EDGE, Frame, LINE, POINTS, ROOM, TEXT, WIDTH, widest};
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

impl Chart {
    /// The picture, to stand in a file or inside a page.
    pub fn svg(&self) -> String {
        let points = self.panels.iter().flat_map(Panel::points);
        // A point on an axis would be cut in half.
        let dotted = self.panels.iter().any(|p| !p.dots.is_empty());
        let x = padded(points.map(|p| p.0), if dotted { 0.05 } else { 0.0 });
        let ticks = Ticks::new(x, 5);
        // The last label may stand under the end of the axis.
        let outermost = widest(&ticks);
        let panels: Vec<Axes<'_>> = self.panels.iter().map(Axes::new).collect();
        let left = panels.iter().map(Axes::margin).fold(0.0, f64::max);
        let lines = self.panels.iter().map(|p| p.series.len()).sum::<usize>();
        let frame = Frame {
            x,
            left,
            right: WIDTH - EDGE.max(outermost / 2.0 + 4.0),
            ticks,
            columns: (POINTS / 2 / lines.max(1)).clamp(1, WIDTH as usize),
        };
        let mut picture = Picture::new(&self.title, &self.description);
        let mut y = picture.top();
        for (i, axes) in panels.iter().enumerate() {
            y = axes.draw(picture.body(), &frame, y + 4.0, i + 1 == panels.len());
        }
        y += 2.0 * LINE - 2.0;
        let middle = 0.5 * (frame.left + frame.right);
        text(
            picture.body(),
            (middle, y),
            "middle",
            TEXT,
            false,
            &clipped(&self.x, TEXT, ROOM),
        );
        picture.svg(y + EDGE)
    }
}
