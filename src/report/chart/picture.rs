//! The frame of every picture: size, title, words for those who cannot see it.

use super::frame::{EDGE, LARGEST, ROOM, TITLE, WIDTH};
use super::text::{BOLD, clipped, escaped, text};

/// A picture that is being drawn.
pub(super) struct Picture<'a> {
    title: &'a str,
    description: &'a str,
    body: String,
}

impl<'a> Picture<'a> {
    /// Creates a picture with its title.
    pub(super) fn new(title: &'a str, description: &'a str) -> Self {
        let mut body = String::new();
        let shown = clipped(title, TITLE * BOLD, ROOM);
        text(
            &mut body,
            (EDGE, EDGE + TITLE),
            "start",
            TITLE,
            true,
            &shown,
        );
        Self {
            title,
            description,
            body,
        }
    }

    /// Returns the upper end of the room below the title.
    pub(super) fn top(&self) -> f64 {
        EDGE + TITLE + 4.0
    }

    /// Returns the drawing, to add to it.
    pub(super) fn body(&mut self) -> &mut String {
        &mut self.body
    }

    /// The whole, so high.
    pub(super) fn svg(self, height: f64) -> String {
        format!(
            concat!(
                r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height:.0}" width="100%" "#,
                r#"style="max-width:{largest}px;height:auto" role="img" font-family="system-ui, sans-serif" fill="{ink}">"#,
                "\n<title>{title}</title>\n<desc>{description}</desc>\n",
                r##"<rect width="{width}" height="{height:.0}" fill="#ffffff"/>"##,
                "\n{body}</svg>\n"
            ),
            width = WIDTH,
            height = height,
            largest = LARGEST,
            ink = "#222222",
            title = escaped(self.title),
            description = escaped(self.description),
            body = self.body,
        )
    }
}
