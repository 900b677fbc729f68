//! Draws of several quantities, each against each.

use super::axis::padded;
use super::canvas::{Canvas, EDGE, LINE, ROOM, TEXT, WIDTH, clipped, width};
use super::panel::Style;
use crate::report::digits::short;
use std::fmt::Write;

/// Columns of a histogram.
const BINS: usize = 16;
/// Dots in one cell: more only blot.
const DOTS: usize = 600;
/// Between cells, and inside them.
const GAP: f64 = 6.0;
const INSIDE: f64 = 4.0;

/// Histograms on the diagonal, dots below it.
#[derive(Debug, Clone, PartialEq)]
pub struct Pairs {
    /// Heading, also for screen readers.
    pub title: String,
    /// Description for screen readers.
    pub description: String,
    /// Name with unit and draws of each quantity.
    pub columns: Vec<(String, Vec<f64>)>,
    /// Group of each draw, from 0: groups have colours.
    pub groups: Vec<usize>,
}

impl Pairs {
    /// The picture, to stand in a file or inside a page.
    pub fn svg(&self) -> String {
        let k = self.columns.len().max(1) as f64;
        let (mut canvas, top) = Canvas::new(&self.title, &self.description);
        let top = top + LINE;
        let cell = (WIDTH - 2.0 * EDGE - (k - 1.0) * GAP) / k;
        let ranges: Vec<(f64, f64)> = (self.columns.iter())
            .map(|(_, values)| padded(values.iter().copied(), 0.0))
            .collect();
        let at = |i: usize| EDGE + i as f64 * (cell + GAP);
        for (row, (name, values)) in self.columns.iter().enumerate() {
            let y = top + row as f64 * (cell + GAP);
            for (column, (_, across)) in self.columns[..row].iter().enumerate() {
                let place = Cell::new(&mut canvas, (at(column), y), cell);
                let ranges = (ranges[column], ranges[row]);
                self.dots(&mut canvas, &place, ranges, across, values);
            }
            let place = Cell::new(&mut canvas, (at(row), y), cell);
            histogram(&mut canvas, &place, ranges[row], values);
            let room = ROOM - at(row) + EDGE;
            let name = clipped(name, TEXT, room);
            canvas.text((at(row) + 2.0, y - 4.0), "start", true, &name);
        }
        let bottom = top + k * (cell + GAP) - GAP;
        for (column, range) in ranges.iter().enumerate() {
            let ends = [(range.0, "start", 0.0), (range.1, "end", cell)];
            let labels = ends.map(|(value, ..)| short(value));
            // Narrow cells have room for one end in a line.
            let is_narrow = labels.iter().map(|l| width(l, TEXT)).sum::<f64>() + GAP > cell;
            for (i, ((_, anchor, off), label)) in ends.iter().zip(&labels).enumerate() {
                let line = if is_narrow { i as f64 } else { 0.0 };
                let place = (at(column) + off, bottom + (line + 1.0) * LINE - 3.0);
                canvas.text(place, anchor, false, label);
            }
        }
        canvas.svg(bottom + 2.0 * LINE + EDGE)
    }

    fn dots(
        &self,
        canvas: &mut Canvas,
        place: &Cell,
        (x, y): ((f64, f64), (f64, f64)),
        across: &[f64],
        up: &[f64],
    ) {
        let every = across.len().div_ceil(DOTS).max(1);
        let groups = self.groups.iter().copied().max().unwrap_or(0);
        for group in 0..=groups {
            let style = Style::OTHERS[group % Style::OTHERS.len()];
            let mut path = String::new();
            for i in (0..across.len()).step_by(every) {
                if self.groups.get(i).copied().unwrap_or(0) == group {
                    let (px, py) = place.point(share(x, across[i]), share(y, up[i]));
                    let _ = write!(path, "M{px:.1} {py:.1}h0");
                }
            }
            let colour = style.colour;
            canvas.path(&path, &format!(
                r#"stroke="{colour}" stroke-opacity="0.4" stroke-width="2.6" stroke-linecap="round""#
            ));
        }
    }
}

/// Where a value lies in a range, from 0 to 1.
fn share((low, high): (f64, f64), value: f64) -> f64 {
    ((value - low) / (high - low)).clamp(0.0, 1.0)
}

fn histogram(canvas: &mut Canvas, place: &Cell, range: (f64, f64), values: &[f64]) {
    let mut counts = [0usize; BINS];
    for value in values.iter().filter(|v| v.is_finite()) {
        counts[((share(range, *value) * BINS as f64) as usize).min(BINS - 1)] += 1;
    }
    let most = counts.iter().copied().max().unwrap_or(0).max(1) as f64;
    let (x, y) = place.point(0.0, 0.0);
    let mut path = format!("M{x:.1} {y:.1}");
    for (i, count) in counts.iter().enumerate() {
        let (_, y) = place.point(0.0, *count as f64 / most);
        let (x, _) = place.point((i + 1) as f64 / BINS as f64, 0.0);
        let _ = write!(path, "V{y:.1}H{x:.1}");
    }
    let fill = r##"fill="#0072b2" fill-opacity="0.3" stroke="#0072b2""##;
    canvas.path(&format!("{path}V{y:.1}Z"), fill);
}

/// A square.
struct Cell {
    left: f64,
    top: f64,
    size: f64,
}

impl Cell {
    /// Draws its frame.
    fn new(canvas: &mut Canvas, (left, top): (f64, f64), size: f64) -> Self {
        let frame = r##"fill="none" stroke="#bbbbbb""##;
        canvas.rectangle((left, top), size, size, frame);
        Self { left, top, size }
    }

    /// A point inside, from shares of the axes.
    fn point(&self, x: f64, y: f64) -> (f64, f64) {
        let room = self.size - 2.0 * INSIDE;
        (
            self.left + INSIDE + x * room,
            self.top + self.size - INSIDE - y * room,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pair_has_its_cell() {
        let column = |name: &str, by: f64| {
            let values = (0..2000).map(|i| by * (f64::from(i) * 0.7).sin());
            (name.to_owned(), values.collect())
        };
        let pairs = Pairs {
            title: "t".into(),
            description: "d".into(),
            columns: vec![column("a <m>", 1.0), column("b", 2.0), column("c", 3.0)],
            groups: (0..2000).map(|i| usize::from(i > 1000)).collect(),
        };
        let svg = pairs.svg();
        // Three histograms, three pairs in two colours each; a third of the draws is drawn.
        assert_eq!(svg.matches("<rect").count(), 1 + 6);
        assert_eq!(svg.matches("stroke-opacity").count(), 6);
        assert!(svg.matches("h0").count() <= 3 * DOTS);
        assert!(svg.contains("a &lt;m&gt;") && !svg.contains("NaN"));
    }
}
