//! Horizontal bars with their names on the left, their numbers on the right, and a scale below.

use super::axis::Ticks;
use super::canvas::{BOLD, Canvas, EDGE, GAP, GRID, LINE, ROOM, TEXT, WIDTH, clipped, width};
use crate::math::nearest;

/// Height of a row and of the bar inside it.
const ROW: f64 = 25.0;
const BAR: f64 = 15.0;

/// Bars under a heading.
#[derive(Debug, Clone, PartialEq)]
pub struct BarGroup {
    /// Heading; empty for none.
    pub label: String,
    /// The value that takes all the room; if none, the largest of all groups without.
    pub full: Option<f64>,
    /// The scale is in per cent.
    pub per_cent: bool,
    /// Ordered from top to bottom.
    pub bars: Vec<Bar>,
}

/// One bar.
#[derive(Debug, Clone, PartialEq)]
pub struct Bar {
    /// Name.
    pub label: String,
    /// Length; nothing is drawn of what is negative or not finite.
    pub value: f64,
    /// The number in words.
    pub note: String,
    /// Filled, and named in bold; otherwise hollow.
    pub clear: bool,
    /// Ends of an interval around the value.
    pub interval: Option<[f64; 2]>,
}

impl BarGroup {
    /// Returns bars under `label`; `full` is the value that takes all the room.
    pub fn new(label: &str, full: Option<f64>, bars: Vec<Bar>) -> Self {
        Self {
            label: label.into(),
            full,
            per_cent: false,
            bars,
        }
    }

    /// The scale in per cent.
    pub fn per_cent(self) -> Self {
        Self {
            per_cent: true,
            ..self
        }
    }
}

impl Bar {
    /// A hollow bar without an interval.
    pub fn new(label: &str, value: f64, note: &str) -> Self {
        Self {
            label: label.into(),
            value,
            note: note.into(),
            clear: false,
            interval: None,
        }
    }

    /// Filled or hollow.
    pub fn clear(self, clear: bool) -> Self {
        Self { clear, ..self }
    }

    /// Sets the interval.
    pub fn interval(self, interval: Option<[f64; 2]>) -> Self {
        Self { interval, ..self }
    }
}

/// Groups of bars from top to bottom. Scales begin at zero.
pub fn bar_chart(title: &str, description: &str, groups: &[BarGroup]) -> String {
    let bars = || groups.iter().flat_map(|group| &group.bars);
    let widest = |needs: fn(&Bar) -> f64| bars().map(needs).fold(0.0, f64::max);
    let names = widest(|bar| width(&bar.label, TEXT * BOLD)).min(0.46 * ROOM);
    let notes = widest(|bar| width(&bar.note, TEXT));
    let left = EDGE + names + GAP;
    let right = (WIDTH - EDGE - notes - GAP).max(left + ROW);
    let shared = (groups.iter())
        .filter(|group| group.full.is_none())
        .flat_map(|group| &group.bars)
        .map(|bar| bar.value)
        .filter(|value| value.is_finite())
        .fold(0.0, f64::max);
    let (mut canvas, top) = Canvas::new(title, description);
    let mut y = top + 4.0;
    for (i, group) in groups.iter().enumerate() {
        if !group.label.is_empty() {
            y += LINE;
            let label = clipped(&group.label, TEXT * BOLD, ROOM);
            canvas.text((EDGE, y), "start", true, &label);
            y += 4.0;
        }
        let scale = Scale {
            left,
            right,
            full: group.full.unwrap_or(shared),
            per_cent: group.per_cent,
        };
        let bottom = y + ROW * group.bars.len() as f64;
        for (x, _) in scale.ticks() {
            canvas.vertical(x, (y, bottom), GRID);
        }
        for bar in &group.bars {
            bar.draw(&mut canvas, &scale, names, y);
            y += ROW;
        }
        let next = groups.get(i + 1);
        if next.is_none_or(|next| (next.full, next.per_cent) != (group.full, group.per_cent)) {
            y = scale.draw_labels(&mut canvas, bottom);
        }
    }
    canvas.svg(y + EDGE)
}

/// Scale from values to positions; it begins at zero.
struct Scale {
    left: f64,
    right: f64,
    /// The value at the right end; nothing is drawn where it is not positive.
    full: f64,
    per_cent: bool,
}

impl Scale {
    fn x(&self, value: f64) -> f64 {
        let share = match self.full > 0.0 {
            true => value / self.full,
            false => 0.0,
        };
        nearest(
            self.left + share * (self.right - self.left),
            self.left,
            self.right,
        )
    }

    /// Positions and labels of its ticks.
    fn ticks(&self) -> Vec<(f64, String)> {
        let unit = if self.per_cent { 100.0 } else { 1.0 };
        // Each tick has 64 units.
        let wanted = ((self.right - self.left) / 64.0) as usize;
        let end = unit * self.full;
        if wanted == 0 || !(end > 0.0 && end.is_finite()) {
            return vec![];
        }
        (Ticks::new((0.0, end), wanted).labelled())
            .map(|(value, label)| (self.x(value / unit), label))
            .collect()
    }

    /// Names the ticks below; returns where that ends.
    fn draw_labels(&self, canvas: &mut Canvas, top: f64) -> f64 {
        let ticks = self.ticks();
        let per_cent = if self.per_cent { " %" } else { "" };
        for (x, label) in &ticks {
            let at = (*x, top + LINE - 4.0);
            canvas.text(at, "middle", false, &format!("{label}{per_cent}"));
        }
        if ticks.is_empty() { top } else { top + LINE }
    }
}

impl Bar {
    /// Draws the row that begins at `top`.
    fn draw(&self, canvas: &mut Canvas, scale: &Scale, names: f64, top: f64) {
        let middle = top + 0.5 * ROW;
        let baseline = middle + 0.35 * TEXT;
        let label = clipped(&self.label, TEXT * BOLD, names);
        canvas.text((scale.left - GAP, baseline), "end", self.clear, &label);
        let mut end = scale.left;
        if self.value.is_finite() && self.value > 0.0 {
            end = scale.x(self.value);
            let fill = if self.clear { "#0072b2" } else { "#ffffff" };
            let fill = format!(r##"fill="{fill}" stroke="#0072b2""##);
            canvas.rectangle(
                (scale.left, middle - 0.5 * BAR),
                end - scale.left,
                BAR,
                &fill,
            );
        }
        if let Some(ends) = self
            .interval
            .filter(|ends| ends.iter().all(|v| v.is_finite()))
        {
            let [low, high] = ends.map(|value| scale.x(value));
            let (up, down) = (middle - 5.0, middle + 5.0);
            let path = format!(
                "M{low:.1} {up:.1}V{down:.1}M{low:.1} {middle:.1}H{high:.1}M{high:.1} {up:.1}V{down:.1}"
            );
            // White below black: it is seen on a filled bar and beyond it.
            for (colour, width) in [("#ffffff", 4.0), ("#222222", 1.5)] {
                let line = format!(r#"fill="none" stroke="{colour}" stroke-width="{width}""#);
                canvas.path(&path, &line);
            }
            end = end.max(high);
        }
        canvas.text((end + GAP, baseline), "start", false, &self.note);
    }
}
