//! Documents as pages.
//!
//! A page has one heading, a link past its table of contents, landmarks and a section a question. Wide pictures and tables scroll
//! inside their own frames, which the keyboard reaches too; what is secondary is folded, and unfolded in print. There are no
//! scripts, and nothing is loaded from elsewhere.

use super::{Block, Column, Document, Matrix, Picture, Section, Shade, TableBlock, escaped};

/// Colours have a contrast of at least 4.5 to 1.
const STYLE: &str = include_str!("page.css");

impl Document {
    /// A self-contained page for screen, phone and print.
    pub fn html(&self) -> String {
        let title = escaped(&self.title);
        let byline = tagged("p class=\"byline\"", &self.byline);
        let answer = all(&self.title, &self.answer);
        let picture = self.picture.as_ref().map_or(String::new(), Picture::html);
        let contents: String = (self.sections.iter())
            .map(|s| format!("<li><a href=\"#{}\">{}</a></li>\n", s.id, escaped(s.title)))
            .collect();
        let sections: String = self.sections.iter().map(Section::html).collect();
        let footer: Vec<String> = self.footer.iter().map(|line| escaped(line)).collect();
        let footer = match footer.join("<br>\n") {
            lines if lines.is_empty() => lines,
            lines => format!("<footer><p>{lines}</p></footer>\n"),
        };
        let style: String = STYLE.lines().map(str::trim).collect();
        format!(
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n\
             <style>{style}</style>\n</head>\n<body>\n<a class=\"skip\" href=\"#content\">Skip to the content</a>\n\
             <header>\n<h1>{title}</h1>\n{byline}<div class=\"first\">\n<div>\n{answer}</div>\n{picture}</div>\n</header>\n\
             <nav aria-label=\"On this page\">\n<ul>\n{contents}</ul>\n</nav>\n\
             <main id=\"content\" tabindex=\"-1\">\n{sections}</main>\n{footer}</body>\n</html>\n"
        )
    }
}

impl Section {
    fn html(&self) -> String {
        let (id, title) = (self.id, escaped(self.title));
        let [brief, rest] = [&self.brief, &self.rest].map(|blocks| all(self.title, blocks));
        format!(
            "<section id=\"{id}\" aria-labelledby=\"{id}-heading\">\n<h2 id=\"{id}-heading\">{title}</h2>\n{brief}{rest}</section>\n"
        )
    }
}

/// Blocks below a heading.
fn all(heading: &str, blocks: &[Block]) -> String {
    let mut heading = heading;
    let mut page = String::new();
    for block in blocks {
        if let Block::Heading(text) = block {
            heading = text;
        }
        page += &block.html(heading);
    }
    page
}

/// A text in a tag, which may have attributes; nothing of an empty one.
fn tagged(tag: &str, text: &str) -> String {
    let name = tag.split(' ').next().unwrap_or(tag);
    match escaped(text) {
        text if text.is_empty() => text,
        text => format!("<{tag}>{text}</{name}>\n"),
    }
}

fn list<'i>(class: &str, items: impl Iterator<Item = &'i str>) -> String {
    match items.map(|item| tagged("li", item)).collect::<String>() {
        items if items.is_empty() => items,
        items => format!("<ul{class}>\n{items}</ul>\n"),
    }
}

impl Block {
    /// A block below this heading.
    fn html(&self, heading: &str) -> String {
        match self {
            Self::Headline(text) => tagged("p class=\"verdict\"", text),
            Self::Paragraph(text) => tagged("p", text),
            Self::Heading(text) => tagged("h3", text),
            Self::List(items) => list("", items.iter().map(String::as_str)),
            Self::Code(text) => {
                let lines: Vec<String> = text.lines().map(escaped).collect();
                format!("<pre>{}</pre>\n", lines.join("\n"))
            }
            Self::Doubts(doubts) => {
                let items: Vec<String> = (doubts.iter())
                    .map(|doubt| format!("Warning: {}; {}.", doubt.what, doubt.remedy))
                    .collect();
                list(" class=\"doubts\"", items.iter().map(String::as_str))
            }
            Self::Table(table) => table.html(heading),
            Self::Matrix(matrix) => matrix.html(heading),
            Self::Picture(picture) => picture.html(),
            Self::Folded(summary, blocks) => format!(
                "<details>\n{}{}</details>\n",
                tagged("summary", summary),
                all(summary, blocks)
            ),
        }
    }
}

/// A frame that scrolls sideways where its content is wider than the screen.
fn scrolling(what: &str, body: &str) -> String {
    format!(
        "<div class=\"wide\" role=\"group\" tabindex=\"0\" aria-label=\"{what}, may scroll sideways\">\n{body}</div>\n"
    )
}

/// The caption of a table; one that its heading describes has the heading, for those who hear the page.
fn caption(text: &str, heading: &str) -> String {
    match text {
        "" => format!("<caption class=\"heard\">{}</caption>", escaped(heading)),
        text => format!("<caption><span>{}</span></caption>", escaped(text)),
    }
}

fn scrolling_table(class: &str, caption: &str, head: &str, rows: &str) -> String {
    let table = format!(
        "<table{class}>\n{caption}\n<thead><tr>{head}</tr></thead>\n<tbody>\n{rows}</tbody>\n</table>\n"
    );
    scrolling("Table", &table)
}

impl Picture {
    fn html(&self) -> String {
        let caption = escaped(&self.caption);
        let frame = scrolling("Picture", &self.svg);
        format!("<figure>\n{frame}<figcaption>{caption}</figcaption>\n</figure>\n")
    }
}

impl TableBlock {
    fn html(&self, heading: &str) -> String {
        let class = |kind: Column| match kind {
            Column::Text => "",
            Column::Number => " class=\"n\"",
        };
        let head: String = (self.head.iter())
            .map(|(name, kind)| format!("<th scope=\"col\"{}>{}</th>", class(*kind), escaped(name)))
            .collect();
        let row = |cells: &Vec<String>| {
            let cells = cells.iter().zip(&self.head).enumerate();
            let cells: String = cells
                .map(
                    |(j, (cell, (_, kind)))| match (escaped(cell), class(*kind)) {
                        (cell, class) if j == 0 => format!("<th scope=\"row\"{class}>{cell}</th>"),
                        (cell, class) => format!("<td{class}>{cell}</td>"),
                    },
                )
                .collect();
            format!("<tr>{cells}</tr>\n")
        };
        let rows: String = self.rows.iter().map(row).collect();
        scrolling_table("", &caption(&self.caption, heading), &head, &rows)
    }
}

impl Matrix {
    fn html(&self, heading: &str) -> String {
        let head: String = (self.head.iter())
            .map(|name| format!("<th scope=\"col\" class=\"turned\">{}</th>", escaped(name)))
            .collect();
        let rows: String = (self.rows.iter())
            .map(|(name, cells)| {
                let cells: String = cells.iter().map(shaded).collect();
                format!("<tr><th scope=\"row\">{}</th>{cells}</tr>\n", escaped(name))
            })
            .collect();
        let head = format!("<td></td>{head}");
        let caption = caption(&self.caption, heading);
        scrolling_table(" class=\"matrix\"", &caption, &head, &rows)
    }
}

fn shaded(cell: &Option<Shade>) -> String {
    let Some(cell) = cell else {
        return "<td></td>".into();
    };
    let (class, colour) = match cell.right {
        true => (" class=\"right\"", "0 114 178"),
        false => ("", "213 94 0"),
    };
    // At most half: text on it stays legible.
    let opacity = 0.1 + 0.4 * cell.weight.clamp(0.0, 1.0);
    let text = escaped(&cell.text);
    format!("<td{class} style=\"background:rgb({colour} / {opacity:.2})\">{text}</td>")
}
