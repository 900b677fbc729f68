//! Line charts, bars, heat maps and small multiples as SVG.
//!
//! We draw them ourselves: plotters asks for a bundled TrueType font even where it writes SVG, and an axis, a legend
//! and a line need none. Text is text in the reader's own font; colours are told apart by colour-blind people (Okabe &
//! Ito) and lines by their dashes as well; the picture scales to the width that it is given and stands on white, so
//! that it reads on light and dark pages.

mod axes;
mod bars;
mod decimate;
mod heat;
mod layers;
mod multiples;
mod picture;
mod strip;
mod text;
mod ticks;

pub use bars::{Bar, BarChart, BarGroup};
pub use heat::{HeatGroup, HeatMap, HeatRow};
pub use layers::{Area, Dot, Dots, Mark};
pub use multiples::{Facet, FacetRow, Multiples, Step};
pub use strip::{Edge, Span};
pub(super) use text::escaped;

use axes::{Axes, Frame};
use picture::Picture;
use std::ops::RangeInclusive;
use text::{clipped, text, width};
use ticks::{Ticks, padded};

/// Width in user units: narrow, so that text is still legible on a phone.
const WIDTH: f64 = 520.0;
/// Widest on a page, in CSS pixels.
const LARGEST: u32 = 880;
/// Distance of anything from the edge.
const EDGE: f64 = 12.0;
/// Font sizes of the title and of everything else, and the height of a line of text.
const TITLE: f64 = 17.0;
const TEXT: f64 = 14.0;
const LINE: f64 = 20.0;
/// Room for a text that has a row to itself.
const ROOM: f64 = WIDTH - 2.0 * EDGE;
/// Points of all lines together: keeps a file under 300 KiB.
const POINTS: usize = 20_000;

/// Panels above each other along one x axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Heading, also for screen readers.
    pub title: String,
    /// What the picture shows, for those who cannot see it.
    pub description: String,
    /// Quantity and unit of the x axis.
    pub x: String,
    /// From top to bottom.
    pub panels: Vec<Panel>,
}

/// One pair of axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Quantity and unit of the y axis.
    pub y: String,
    /// Height of the axes in user units; the chart is 520 wide.
    pub height: f64,
    /// Lines, the first at the back.
    pub series: Vec<Series>,
    /// Stretches of the x axis, marked below it.
    pub spans: Vec<Span>,
    /// Bands below the lines.
    pub areas: Vec<Area>,
    /// Points with their intervals, over the lines.
    pub dots: Vec<Dots>,
    /// Places on the x axis.
    pub marks: Vec<Mark>,
    /// Ends of the y axis; if none, what the values need.
    pub range: Option<(f64, f64)>,
}

impl Panel {
    /// A panel of the usual height.
    pub fn new(y: &str, series: Vec<Series>) -> Self {
        Self {
            y: y.into(),
            height: 190.0,
            series,
            spans: vec![],
            areas: vec![],
            dots: vec![],
            marks: vec![],
            range: None,
        }
    }

    /// With marked stretches of the x axis.
    pub fn spans(self, spans: Vec<Span>) -> Self {
        Self { spans, ..self }
    }

    /// With a band below the lines.
    pub fn area(mut self, area: Area) -> Self {
        self.areas.push(area);
        self
    }

    /// With points and their intervals.
    pub fn dots(mut self, dots: Dots) -> Self {
        self.dots.push(dots);
        self
    }

    /// With marked places on the x axis.
    pub fn marks(self, marks: Vec<Mark>) -> Self {
        Self { marks, ..self }
    }

    /// With these ends of the y axis.
    pub fn range(self, low: f64, high: f64) -> Self {
        Self {
            range: Some((low, high)),
            ..self
        }
    }

    /// All points of all layers.
    fn points(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let lines = self.series.iter().flat_map(|s| s.points.iter().copied());
        let areas = (self.areas.iter().flat_map(|a| &a.points))
            .flat_map(|&(x, low, high)| [(x, low), (x, high)]);
        let dots = (self.dots.iter().flat_map(|d| &d.points))
            .flat_map(|d| [(d.x, d.low), (d.x, d.y), (d.x, d.high)]);
        lines.chain(areas).chain(dots)
    }

    /// With another height in user units.
    pub fn height(self, height: f64) -> Self {
        Self { height, ..self }
    }
}

/// One line.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// In the legend; empty for none.
    pub label: String,
    /// Colour, width, dashes.
    pub style: Style,
    /// (x, y), sorted by x. A value that is not finite breaks the line.
    pub points: Vec<(f64, f64)>,
}

impl Series {
    /// From its points, sorted by x.
    pub fn new(label: &str, style: Style, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self {
            label: label.into(),
            style,
            points: points.into_iter().collect(),
        }
    }

    /// Broken off where it leaves `range`: one line that runs away would leave no room for the others.
    pub fn within(mut self, range: RangeInclusive<f64>) -> Self {
        for (_, y) in &mut self.points {
            if !range.contains(y) {
                *y = f64::NAN;
            }
        }
        self
    }
}

/// The range of some values, wider by half of itself on either side.
pub(super) fn roomy(values: impl Iterator<Item = f64>) -> RangeInclusive<f64> {
    let (low, high) = padded(values, 0.5);
    low..=high
}

/// How a line is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Style {
    /// A colour of SVG.
    pub colour: &'static str,
    /// In user units.
    pub width: f64,
    /// Lengths of dashes and gaps; empty for an unbroken line.
    pub dash: &'static str,
}

impl Style {
    /// A measured record: broad and pale, so that what is laid over it can be seen.
    pub const RECORD: Self = Self::new("#a6a6a6", 3.0, "");
    /// What was there before.
    pub const BEFORE: Self = Self::new("#d55e00", 1.5, "6 4");
    /// What is there now.
    pub const AFTER: Self = Self::new("#0072b2", 1.5, "");
    /// For anything else, in this order.
    pub const OTHERS: [Self; 5] = [
        Self::AFTER,
        Self::BEFORE,
        Self::new("#009e73", 1.5, "2 3"),
        Self::new("#cc79a7", 1.5, "10 3 2 3"),
        Self::new("#222222", 1.5, "4 2"),
    ];

    const fn new(colour: &'static str, width: f64, dash: &'static str) -> Self {
        Self {
            colour,
            width,
            dash,
        }
    }

    fn stroke(self) -> String {
        let dash = match self.dash {
            "" => String::new(),
            dash => format!(r#" stroke-dasharray="{dash}""#),
        };
        format!(
            r#"stroke="{}" stroke-width="{}"{dash}"#,
            self.colour, self.width
        )
    }
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

/// Width of the widest label.
fn widest(ticks: &Ticks) -> f64 {
    (ticks.labelled())
        .map(|(_, label)| width(&label, TEXT))
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests;

#[cfg(test)]
mod examples {
    #[test]
    fn the_example() {
        use crate::report::chart::{Chart, Panel, Series, Style};
        let chart = Chart {
            title: "Step response".into(),
            description: "The level rises to 2 V within 3 s.".into(),
            x: "t in s".into(),
            panels: vec![Panel::new(
                "level in V",
                vec![Series::new(
                    "measured",
                    Style::RECORD,
                    (0..4).map(|k| (k as f64, 2.0 - 0.5f64.powi(k))),
                )],
            )],
        };
        assert!(chart.svg().starts_with("<svg"));
    }
}
