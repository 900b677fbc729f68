//! The picture that everything is drawn on: size, title, text whose font is not known, words for those who cannot see it.

use std::fmt::Write;

/// Width in user units: narrow, so that text is still legible on a phone.
pub(super) const WIDTH: f64 = 520.0;
/// Distance of anything from the edge.
pub(super) const EDGE: f64 = 12.0;
/// Font sizes of the title and of everything else, and the height of a line of text.
const TITLE: f64 = 17.0;
pub(super) const TEXT: f64 = 14.0;
pub(super) const LINE: f64 = 20.0;
/// Between names and what they name.
pub(super) const GAP: f64 = 8.0;
/// Room for a text that has a row to itself.
pub(super) const ROOM: f64 = WIDTH - 2.0 * EDGE;
/// Width of a character over the font size, in the widest of common fonts.
const CHARACTER: f64 = 0.55;
/// Size that a bold text needs over its own.
pub(super) const BOLD: f64 = 1.1;
/// Colours of grid lines and of axes.
pub(super) const GRID: &str = r##"stroke="#e4e4e4""##;
pub(super) const AXIS: &str = r##"fill="none" stroke="#555555""##;

/// A picture that is being drawn.
pub(super) struct Canvas {
    head: String,
    body: String,
}

impl Canvas {
    /// A picture with its title, and a description for screen readers; returns the upper end of the room below the title, too.
    pub fn new(title: &str, description: &str) -> (Self, f64) {
        let (heading, words) = (escaped(title), escaped(description));
        let mut canvas = Self {
            head: format!("<title>{heading}</title>\n<desc>{words}</desc>\n"),
            body: String::new(),
        };
        let shown = clipped(title, TITLE * BOLD, ROOM);
        canvas.sized((EDGE, EDGE + TITLE), "start", TITLE, true, &shown);
        (canvas, EDGE + TITLE + 4.0)
    }

    /// A line of text at (x, y), y at its baseline.
    pub fn text(&mut self, at: (f64, f64), anchor: &str, bold: bool, what: &str) {
        self.sized(at, anchor, TEXT, bold, what);
    }

    fn sized(&mut self, (x, y): (f64, f64), anchor: &str, size: f64, bold: bool, what: &str) {
        let weight = if bold { r#" font-weight="600""# } else { "" };
        let what = escaped(what);
        let _ = writeln!(
            self.body,
            r#"<text x="{x:.1}" y="{y:.1}" font-size="{size}" text-anchor="{anchor}"{weight}>{what}</text>"#
        );
    }

    /// A path with the attributes of its line.
    pub fn path(&mut self, path: &str, attributes: &str) {
        let _ = writeln!(self.body, r#"<path d="{path}" {attributes}/>"#);
    }

    pub fn vertical(&mut self, x: f64, (top, bottom): (f64, f64), attributes: &str) {
        self.path(&format!("M{x:.1} {top:.1}V{bottom:.1}"), attributes);
    }

    pub fn horizontal(&mut self, (left, right): (f64, f64), y: f64, attributes: &str) {
        self.path(&format!("M{left:.1} {y:.1}H{right:.1}"), attributes);
    }

    pub fn rectangle(&mut self, (x, y): (f64, f64), width: f64, height: f64, attributes: &str) {
        let _ = writeln!(
            self.body,
            r#"<rect x="{x:.1}" y="{y:.1}" width="{width:.1}" height="{height:.1}" {attributes}/>"#
        );
    }

    pub fn circle(&mut self, (x, y): (f64, f64), radius: f64, attributes: &str) {
        let _ = writeln!(
            self.body,
            r#"<circle cx="{x:.1}" cy="{y:.1}" r="{radius}" {attributes}/>"#
        );
    }

    /// The picture, so high, to stand in a file or inside a page.
    pub fn svg(self, height: f64) -> String {
        let Self { head, body } = self;
        format!(
            r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height:.0}" width="100%" style="max-width:880px;height:auto" role="img" font-family="system-ui, sans-serif" fill="#222222">
{head}<rect width="{WIDTH}" height="{height:.0}" fill="#ffffff"/>
{body}</svg>
"##
        )
    }
}

/// Width of a text in user units, about.
pub(super) fn width(text: &str, size: f64) -> f64 {
    CHARACTER * size * text.chars().count() as f64
}

/// Text that takes at most `room`, its end replaced by an ellipsis.
pub(super) fn clipped(text: &str, size: f64, room: f64) -> String {
    let most = (room / (CHARACTER * size)) as usize;
    if text.chars().count() <= most {
        return text.into();
    }
    text.chars()
        .take(most.saturating_sub(1))
        .chain(['…'])
        .collect()
}

/// Text that XML reads as text; characters that XML has no place for are left out.
pub(in crate::report) fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            c if c.is_control() => safe.push(' '),
            c => safe.push(c),
        }
    }
    safe
}
