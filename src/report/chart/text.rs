//! Text in a picture whose font is not known.

use std::fmt::Write;

/// Width of a character over the font size, in the widest of common fonts.
const CHARACTER: f64 = 0.55;
/// Size that a bold text needs over its own.
pub(super) const BOLD: f64 = 1.1;

/// A line of text at (x, y), y at its baseline.
pub(super) fn text(
    out: &mut String,
    (x, y): (f64, f64),
    anchor: &str,
    size: f64,
    bold: bool,
    what: &str,
) {
    let weight = if bold { r#" font-weight="600""# } else { "" };
    let what = escaped(what);
    let _ = writeln!(
        out,
        r#"<text x="{x:.1}" y="{y:.1}" font-size="{size}" text-anchor="{anchor}"{weight}>{what}</text>"#
    );
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
        .collect::<String>()
        + "…"
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
