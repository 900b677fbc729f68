//! Contents of a panel: lines, bands, points with intervals, marks and stretches of the x axis.

use super::axis::{Across, padded};
use super::canvas::{BOLD, Canvas, TEXT, width};
use std::ops::RangeInclusive;

/// One pair of axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Quantity and unit of the y axis.
    pub y: String,
    /// Height of the axes in user units; the chart is 520 wide.
    pub height: f64,
    /// Lines, the first at the back.
    pub series: Vec<Line>,
    /// Stretches of the x axis, marked below it.
    pub spans: Vec<Span>,
    /// Bands below the lines.
    pub areas: Vec<Area>,
    /// Points with their intervals, over the lines.
    pub dots: Vec<Dots>,
    /// Places on the x axis.
    pub marks: Vec<TimeMark>,
    /// Ends of the y axis; if none, what the values need.
    pub range: Option<(f64, f64)>,
}

impl Panel {
    /// A panel of the usual height.
    pub fn new(y: &str, series: Vec<Line>) -> Self {
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

    /// Sets marked stretches of the x axis.
    pub fn spans(self, spans: Vec<Span>) -> Self {
        Self { spans, ..self }
    }

    /// Adds a band below the lines.
    pub fn area(mut self, area: Area) -> Self {
        self.areas.push(area);
        self
    }

    /// Adds points and their intervals.
    pub fn dots(mut self, dots: Dots) -> Self {
        self.dots.push(dots);
        self
    }

    /// Sets marks on the x axis.
    pub fn marks(self, marks: Vec<TimeMark>) -> Self {
        Self { marks, ..self }
    }

    /// Sets the ends of the y axis.
    pub fn range(self, low: f64, high: f64) -> Self {
        let range = Some((low, high));
        Self { range, ..self }
    }

    /// Sets the height in user units.
    pub fn height(self, height: f64) -> Self {
        Self { height, ..self }
    }

    /// All points of all layers.
    pub(super) fn points(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let lines = self.series.iter().flat_map(|s| s.points.iter().copied());
        let areas = self.areas.iter().flat_map(|a| &a.points);
        let areas = areas.flat_map(|&(x, low, high)| [(x, low), (x, high)]);
        let dots = self.dots.iter().flat_map(|d| &d.points);
        let dots = dots.flat_map(|d| [(d.x, d.low), (d.x, d.y), (d.x, d.high)]);
        lines.chain(areas).chain(dots)
    }
}

/// One line.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Name in the legend; empty for none.
    pub label: String,
    /// Colour, width, dashes.
    pub style: Style,
    /// (x, y), sorted by x. A value that is not finite breaks the line.
    pub points: Vec<(f64, f64)>,
}

impl Line {
    /// Creates a line from points sorted by x.
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
pub fn roomy(values: impl Iterator<Item = f64>) -> RangeInclusive<f64> {
    let (low, high) = padded(values, 0.5);
    low..=high
}

/// Style of a line.
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
    /// The old state.
    pub const BEFORE: Self = Self::new("#d55e00", 1.5, "6 4");
    /// The new state.
    pub const AFTER: Self = Self::new("#0072b2", 1.5, "");
    /// The line that marks zero.
    pub const ZERO: Self = Self::new("#555555", 1.0, "");
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

    /// Attributes of the line.
    pub(super) fn stroke(self) -> String {
        let (colour, width) = (self.colour, self.width);
        let dash = match self.dash {
            "" => String::new(),
            dash => format!(r#" stroke-dasharray="{dash}""#),
        };
        format!(r#"fill="none" stroke="{colour}" stroke-width="{width}"{dash}"#)
    }
}

/// A band between two lines.
#[derive(Debug, Clone, PartialEq)]
pub struct Area {
    /// Name in the legend; empty for none.
    pub label: String,
    /// (x, low, high), sorted by x.
    pub points: Vec<(f64, f64, f64)>,
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

/// A place on the x axis: a dashed line over the whole height, with its name beside it.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeMark {
    /// Position.
    pub x: f64,
    /// Its name.
    pub label: String,
}

impl TimeMark {
    /// Draws the mark between two heights; its name stands at the upper end, on the side with room.
    pub(super) fn draw(&self, canvas: &mut Canvas, across: &Across, ends: (f64, f64)) {
        let x = across.x(self.x);
        let line = r##"stroke="#222222" stroke-width="1.5" stroke-dasharray="2 3""##;
        canvas.vertical(x, ends, line);
        let (at, anchor) = match x + width(&self.label, TEXT) + 6.0 <= across.right {
            true => (x + 5.0, "start"),
            false => (x - 5.0, "end"),
        };
        canvas.text((at, ends.0 + TEXT), anchor, false, &self.label);
    }
}

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
    pub(super) fn draw(&self, canvas: &mut Canvas, across: &Across, top: f64, height: f64) {
        let (from, to) = (across.x(self.from) + 1.0, across.x(self.to) - 1.0);
        // Text on a stretch of full weight must stay legible.
        let opacity = 0.55 * self.weight.clamp(0.0, 1.0);
        let (stroke, bold) = match self.clear {
            true => (r##" stroke="#222222""##, BOLD),
            false => ("", 1.0),
        };
        let fill = format!(r##"fill="#d55e00" fill-opacity="{opacity:.2}"{stroke}"##);
        canvas.rectangle((from, top), (to - from).max(0.0), height, &fill);
        if width(&self.label, TEXT * bold) <= to - from {
            let at = (0.5 * (from + to), top + 0.5 * height + 0.35 * TEXT);
            canvas.text(at, "middle", self.clear, &self.label);
        }
    }
}
