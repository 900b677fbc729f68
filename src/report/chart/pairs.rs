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

/// Draws of quantities, each against each: histograms on the diagonal, dots below it. Columns have a name with a unit; `groups` has the
/// group of each draw, from 0: groups have colours.
pub fn pair_plot(
    title: &str,
    description: &str,
    columns: &[(String, Vec<f64>)],
    groups: &[usize],
) -> String {
    let k = columns.len().max(1) as f64;
    let (mut canvas, top) = Canvas::new(title, description);
    let top = top + LINE;
    let size = (WIDTH - 2.0 * EDGE - (k - 1.0) * GAP) / k;
    let ranges: Vec<(f64, f64)> = (columns.iter())
        .map(|(_, values)| padded(values.iter().copied(), 0.0))
        .collect();
    let at = |i: usize| EDGE + i as f64 * (size + GAP);
    for (row, (name, values)) in columns.iter().enumerate() {
        let y = top + row as f64 * (size + GAP);
        for (column, (_, across)) in columns[..row].iter().enumerate() {
            let place = Square::new(&mut canvas, (at(column), y), size);
            let points: Vec<(f64, f64)> = (across.iter().zip(values))
                .map(|(a, b)| place.point(share(ranges[column], *a), share(ranges[row], *b)))
                .collect();
            dots(&mut canvas, &points, groups);
        }
        let place = Square::new(&mut canvas, (at(row), y), size);
        histogram(&mut canvas, &place, ranges[row], values);
        let name = clipped(name, TEXT, ROOM - at(row) + EDGE);
        canvas.text((at(row) + 2.0, y - 4.0), "start", true, &name);
    }
    let bottom = top + k * (size + GAP) - GAP;
    for (column, range) in ranges.iter().enumerate() {
        let ends = [(range.0, "start", 0.0), (range.1, "end", size)];
        let labels = ends.map(|(value, ..)| short(value));
        // Narrow cells have room for one end in a line.
        let is_narrow = labels.iter().map(|l| width(l, TEXT)).sum::<f64>() + GAP > size;
        for (i, ((_, anchor, off), label)) in ends.iter().zip(&labels).enumerate() {
            let line = if is_narrow { i as f64 } else { 0.0 };
            let place = (at(column) + off, bottom + (line + 1.0) * LINE - 3.0);
            canvas.text(place, anchor, false, label);
        }
    }
    canvas.svg(bottom + 2.0 * LINE + EDGE)
}

/// Draws points, each in the colour of its group.
fn dots(canvas: &mut Canvas, points: &[(f64, f64)], groups: &[usize]) {
    let every = points.len().div_ceil(DOTS).max(1);
    for group in 0..=groups.iter().copied().max().unwrap_or(0) {
        let mut path = String::new();
        for (i, (x, y)) in points.iter().enumerate().step_by(every) {
            if groups.get(i).copied().unwrap_or(0) == group {
                let _ = write!(path, "M{x:.1} {y:.1}h0");
            }
        }
        let colour = Style::OTHERS[group % Style::OTHERS.len()].colour;
        canvas.path(&path, &format!(
            r#"stroke="{colour}" stroke-opacity="0.4" stroke-width="2.6" stroke-linecap="round""#
        ));
    }
}

/// Where a value lies in a range, from 0 to 1.
fn share((low, high): (f64, f64), value: f64) -> f64 {
    ((value - low) / (high - low)).clamp(0.0, 1.0)
}

fn histogram(canvas: &mut Canvas, place: &Square, range: (f64, f64), values: &[f64]) {
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
struct Square {
    left: f64,
    top: f64,
    size: f64,
}

impl Square {
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
        let columns = [column("a <m>", 1.0), column("b", 2.0), column("c", 3.0)];
        let groups: Vec<usize> = (0..2000).map(|i| usize::from(i > 1000)).collect();
        let svg = pair_plot("t", "d", &columns, &groups);
        // Three histograms, three pairs in two colours each; a third of the draws is drawn.
        assert_eq!(svg.matches("<rect").count(), 1 + 6);
        assert_eq!(svg.matches("stroke-opacity").count(), 6);
        assert!(svg.matches("h0").count() <= 3 * DOTS);
        assert!(svg.contains("a &lt;m&gt;") && !svg.contains("NaN"));
    }
}
