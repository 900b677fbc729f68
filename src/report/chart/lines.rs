//! Line charts: panels above each other along x axes.

use super::axis::{Across, Ticks, padded};
use super::canvas::{AXIS, BOLD, Canvas, EDGE, GRID, LINE, ROOM, TEXT, WIDTH, clipped, width};
use super::panel::{Area, Dots, Line, Panel, Style};
use std::fmt::Write;

/// Points of all lines together: keeps a file under 300 KiB.
const POINTS: usize = 20_000;
/// Points of a record from which on it is a line: fewer are marked.
const SPARSE: usize = 60;
/// Length of a line in the legend, with the gap after it, and the gap between entries.
const SWATCH: f64 = 28.0;
const GAP: f64 = 16.0;
/// Height of the strip of stretches, and its distance from the axis.
const STRIP: f64 = 22.0;
const BELOW: f64 = 5.0;
const BAND: &str = r##"fill="#0072b2" fill-opacity="0.2""##;
const POINT: &str = r##"fill="#0072b2" stroke="#ffffff""##;
const WHISKER: &str = r##"fill="none" stroke="#222222" stroke-width="1.5""##;

/// Panels above each other along one x axis, which is named; several such below each other.
pub fn chart(title: &str, description: &str, axes: &[(String, Vec<Panel>)]) -> String {
    let (mut canvas, mut y) = Canvas::new(title, description);
    for (x, panels) in axes {
        y = draw(&mut canvas, x, panels, y) + EDGE;
    }
    canvas.svg(y)
}

/// Draws panels along one x axis below `top`; returns the last baseline.
fn draw(canvas: &mut Canvas, x_axis: &str, panels: &[Panel], top: f64) -> f64 {
    let points = panels.iter().flat_map(Panel::points);
    // A point on an axis would be cut in half.
    let dotted = panels.iter().any(|p| !p.dots.is_empty());
    let range = padded(points.map(|p| p.0), if dotted { 0.05 } else { 0.0 });
    let ticks = Ticks::new(range, 5);
    let lines = panels.iter().map(|p| p.series.len()).sum::<usize>();
    let all: Vec<Axes<'_>> = panels.iter().map(Axes::new).collect();
    let margin = all
        .iter()
        .map(|axes| axes.ticks.widest())
        .fold(0.0, f64::max);
    let across = Across {
        range,
        left: EDGE + margin + 8.0,
        // The last label may stand under the end of the axis.
        right: WIDTH - EDGE.max(ticks.widest() / 2.0 + 4.0),
        ticks,
    };
    let columns = (POINTS / 2 / lines.max(1)).clamp(1, WIDTH as usize);
    let mut y = top;
    for (i, axes) in all.iter().enumerate() {
        y = axes.draw(canvas, &across, columns, y + 4.0, i + 1 == all.len());
    }
    y += 2.0 * LINE - 2.0;
    let middle = 0.5 * (across.left + across.right);
    let room = 2.0 * (WIDTH - EDGE - middle).min(middle - EDGE);
    canvas.text((middle, y), "middle", false, &clipped(x_axis, TEXT, room));
    y
}

/// A panel with its range and ticks.
struct Axes<'a> {
    panel: &'a Panel,
    range: (f64, f64),
    ticks: Ticks,
}

impl<'a> Axes<'a> {
    fn new(panel: &'a Panel) -> Self {
        let range = (panel.range).unwrap_or_else(|| padded(panel.points().map(|p| p.1), 0.05));
        let ticks = Ticks::new(range, (panel.height / 34.0) as usize);
        Self {
            panel,
            range,
            ticks,
        }
    }

    /// Draws below `top`; returns where it ends.
    fn draw(
        &self,
        canvas: &mut Canvas,
        across: &Across,
        columns: usize,
        top: f64,
        last: bool,
    ) -> f64 {
        let panel = self.panel;
        let mut top = self.legend(canvas, top) + 14.0;
        if !panel.marks.is_empty() {
            // Their names stand above the lines.
            top += LINE - 6.0;
        }
        let bottom = top + panel.height;
        let (low, high) = self.range;
        let y = |value: f64| bottom - (value - low) / (high - low) * panel.height;
        let end = match panel.spans.is_empty() {
            true => bottom,
            false => bottom + BELOW + STRIP,
        };
        for (value, label) in across.ticks.labelled() {
            canvas.vertical(across.x(value), (top, bottom), GRID);
            if last {
                canvas.text((across.x(value), end + LINE - 3.0), "middle", false, &label);
            }
        }
        let (left, right) = (across.left, across.right);
        for (value, label) in self.ticks.labelled() {
            let zero = r##"stroke="#a8a8a8""##;
            canvas.horizontal(
                (left, right),
                y(value),
                if value == 0.0 { zero } else { GRID },
            );
            canvas.text((left - 6.0, y(value) + 0.35 * TEXT), "end", false, &label);
        }
        canvas.path(&format!("M{left:.1} {top:.1}V{bottom:.1}H{right:.1}"), AXIS);
        for area in &panel.areas {
            band(canvas, across, &y, area);
        }
        for series in &panel.series {
            line(canvas, across, &y, series, columns);
        }
        for dots in &panel.dots {
            whiskers(canvas, across, &y, dots);
        }
        for mark in &panel.marks {
            mark.draw(canvas, across, (top - LINE, bottom));
        }
        for span in &panel.spans {
            span.draw(canvas, across, bottom + BELOW, STRIP);
        }
        end
    }

    /// The quantity, then lines with their labels: beside it, or below in as many rows as they need. Returns the last baseline.
    fn legend(&self, canvas: &mut Canvas, top: f64) -> f64 {
        let quantity = clipped(&self.panel.y, TEXT * BOLD, ROOM);
        let mut at = (EDGE, top + LINE);
        canvas.text(at, "start", true, &quantity);
        at.0 += width(&quantity, TEXT * BOLD) + GAP;
        let entries: Vec<(String, Swatch)> = (swatches(self.panel))
            .map(|(label, swatch)| (clipped(label, TEXT, ROOM - SWATCH), swatch))
            .collect();
        let needs = |label: &str| SWATCH + width(label, TEXT);
        let all: f64 = entries.iter().map(|(label, _)| needs(label) + GAP).sum();
        if at.0 + all - GAP > WIDTH - EDGE && !entries.is_empty() {
            at = (EDGE, at.1 + LINE);
        }
        for (label, swatch) in entries {
            if at.0 > EDGE && at.0 + needs(&label) > WIDTH - EDGE {
                at = (EDGE, at.1 + LINE);
            }
            swatch.draw(canvas, (at.0, at.1 - 0.35 * TEXT), SWATCH - 6.0);
            canvas.text((at.0 + SWATCH, at.1), "start", false, &label);
            at.0 += needs(&label) + GAP;
        }
        at.1
    }
}

/// All named layers, lines first.
fn swatches(panel: &Panel) -> impl Iterator<Item = (&str, Swatch)> {
    let lines = panel
        .series
        .iter()
        .map(|s| (s.label.as_str(), Swatch::Line(s.style)));
    let areas = panel.areas.iter().map(|a| (a.label.as_str(), Swatch::Area));
    let dots = panel.dots.iter().map(|d| (d.label.as_str(), Swatch::Dot));
    lines
        .chain(areas)
        .chain(dots)
        .filter(|(label, _)| !label.is_empty())
}

/// Symbol before a name in the legend.
enum Swatch {
    Line(Style),
    Area,
    Dot,
}

impl Swatch {
    /// Draws the symbol from (x, y) on.
    fn draw(&self, canvas: &mut Canvas, (x, y): (f64, f64), long: f64) {
        match self {
            Self::Line(style) => canvas.horizontal((x, x + long), y, &style.stroke()),
            Self::Area => canvas.rectangle((x, y - 5.0), long, 10.0, BAND),
            Self::Dot => {
                canvas.vertical(x + 0.5 * long, (y - 8.0, y + 8.0), WHISKER);
                canvas.circle((x + 0.5 * long, y), 4.5, POINT);
            }
        }
    }
}

fn band(canvas: &mut Canvas, across: &Across, y: &impl Fn(f64) -> f64, area: &Area) {
    let finite = || (area.points.iter()).filter(|(_, low, high)| (low + high).is_finite());
    let upper = finite().map(|(x, _, high)| (x, high));
    let lower = finite().rev().map(|(x, low, _)| (x, low));
    let mut path = String::new();
    for (i, (x, value)) in upper.chain(lower).enumerate() {
        let pen = if i == 0 { 'M' } else { 'L' };
        let _ = write!(path, "{pen}{:.1} {:.1}", across.x(*x), y(*value));
    }
    if !path.is_empty() {
        canvas.path(&(path + "Z"), BAND);
    }
}

/// A line that breaks at holes; a record of few values is marked.
fn line(
    canvas: &mut Canvas,
    across: &Across,
    y: &impl Fn(f64) -> f64,
    series: &Line,
    columns: usize,
) {
    let (mut path, mut pen) = (String::new(), 'M');
    for (px, py) in decimate(&series.points, columns) {
        if py.is_finite() {
            let _ = write!(path, "{pen}{:.1} {:.1}", across.x(px), y(py));
            pen = 'L';
        } else {
            pen = 'M';
        }
    }
    let joined = format!(r#"{} stroke-linejoin="round""#, series.style.stroke());
    canvas.path(&path, &joined);
    let finite = || series.points.iter().filter(|(_, value)| value.is_finite());
    if series.style == Style::RECORD && finite().count() <= SPARSE {
        for (px, py) in finite() {
            let fill = format!(r#"fill="{}""#, series.style.colour);
            canvas.circle((across.x(*px), y(*py)), 3.5, &fill);
        }
    }
}

fn whiskers(canvas: &mut Canvas, across: &Across, y: &impl Fn(f64) -> f64, dots: &Dots) {
    let finite = (dots.points.iter()).filter(|d| (d.x + d.y + d.low + d.high).is_finite());
    for dot in finite {
        let x = across.x(dot.x);
        let (low, high) = (y(dot.low), y(dot.high));
        let (left, right) = (x - 4.0, x + 4.0);
        canvas.path(
            &format!(
                "M{left:.1} {low:.1}H{right:.1}M{x:.1} {low:.1}V{high:.1}M{left:.1} {high:.1}H{right:.1}"
            ),
            WHISKER,
        );
        canvas.circle((x, y(dot.y)), 4.5, POINT);
    }
}

/// Points of a line that is drawn `columns` columns wide: of each column its lowest and its highest point, in their
/// order, so that peaks stay. A line of at most two points a column is left alone. `points` are sorted by x; a point
/// that is not finite breaks the line and is kept, once a column.
fn decimate(points: &[(f64, f64)], columns: usize) -> Vec<(f64, f64)> {
    let (Some(first), Some(last)) = (points.first(), points.last()) else {
        return vec![];
    };
    let columns = columns.max(1);
    if points.len() <= 2 * columns || last.0 <= first.0 {
        return points.to_vec();
    }
    let scale = columns as f64 / (last.0 - first.0);
    let column = |x: f64| (((x - first.0) * scale) as usize).min(columns - 1);
    let mut kept = Vec::with_capacity(2 * columns);
    for group in points.chunk_by(|a, b| column(a.0) == column(b.0)) {
        let finite = || (0..group.len()).filter(|&i| group[i].1.is_finite());
        let low = finite().min_by(|&i, &j| group[i].1.total_cmp(&group[j].1));
        let high = finite().max_by(|&i, &j| group[i].1.total_cmp(&group[j].1));
        let hole = group.iter().position(|p| !p.1.is_finite());
        let mut chosen: Vec<usize> = [low, high, hole].into_iter().flatten().collect();
        chosen.sort_unstable();
        chosen.dedup();
        kept.extend(chosen.into_iter().map(|i| group[i]));
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extremes_survive_and_short_lines_stay() {
        let mut points: Vec<(f64, f64)> =
            (0..50_000).map(|k| (k as f64, (k as f64).sin())).collect();
        points[12_345].1 = 9.0;
        points[40_000].1 = -7.0;
        let few = decimate(&points, 300);
        assert!(few.len() <= 600);
        assert!(few.contains(&(12_345.0, 9.0)) && few.contains(&(40_000.0, -7.0)));
        assert!(few.is_sorted_by(|a, b| a.0 < b.0));
        assert_eq!(decimate(&points[..600], 300), points[..600]);
    }

    #[test]
    fn a_hole_stays_a_hole() {
        let line = (0..1000).map(|k| (k as f64, if k == 500 { f64::NAN } else { 1.0 }));
        let few = decimate(&line.collect::<Vec<_>>(), 10);
        assert_eq!(few.iter().filter(|p| p.1.is_nan()).count(), 1);
        assert_eq!(decimate(&[], 10), []);
    }
}
