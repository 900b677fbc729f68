//! One panel and its lines.

use super::layers::{Area, Dots, Mark};
use super::strip::Span;
use super::style::Style;
use super::ticks::padded;
use std::ops::RangeInclusive;

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
    pub fn marks(self, marks: Vec<Mark>) -> Self {
        Self { marks, ..self }
    }

    /// Sets the ends of the y axis.
    pub fn range(self, low: f64, high: f64) -> Self {
        Self {
            range: Some((low, high)),
            ..self
        }
    }

    /// All points of all layers.
    pub(super) fn points(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let lines = self.series.iter().flat_map(|s| s.points.iter().copied());
        let areas = (self.areas.iter().flat_map(|a| &a.points))
            .flat_map(|&(x, low, high)| [(x, low), (x, high)]);
        let dots = (self.dots.iter().flat_map(|d| &d.points))
            .flat_map(|d| [(d.x, d.low), (d.x, d.y), (d.x, d.high)]);
        lines.chain(areas).chain(dots)
    }

    /// Sets the height in user units.
    pub fn height(self, height: f64) -> Self {
        Self { height, ..self }
    }
}

/// One line.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Name in the legend; empty for none.
    pub label: String,
    /// Colour, width, dashes.
    pub style: Style,
    /// (x, y), sorted by x. A value that is not finite breaks the line.
    pub points: Vec<(f64, f64)>,
}

impl Series {
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
