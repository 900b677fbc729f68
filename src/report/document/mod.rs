//! The document that every result becomes: one model, rendered as text for the terminal and as a page.
//!
//! A result builds its [`Document`] once. The terminal shows the answer and the brief part of each section; a page shows everything.

mod html;
mod text;

pub(super) use super::chart::escaped;

use crate::fit::Warning;

/// One result for people.
#[derive(Debug, Clone, Default)]
pub(crate) struct Document {
    /// Heading of a page.
    pub title: String,
    /// Files and date, below the heading; empty where they are not known.
    pub byline: String,
    /// The first screen: the answer in a sentence, values, doubts, next step.
    pub answer: Vec<Block>,
    /// Picture beside the answer.
    pub picture: Option<Picture>,
    /// Everything else, in order.
    pub sections: Vec<Section>,
    /// Small print at the end of a page.
    pub footer: Vec<String>,
}

/// A part of a document.
#[derive(Debug, Clone)]
pub(crate) struct Section {
    /// Address inside a page.
    pub id: &'static str,
    pub title: &'static str,
    /// Shown on the terminal, too.
    pub brief: Vec<Block>,
    /// Shown on pages only.
    pub rest: Vec<Block>,
}

/// A piece of a document; all texts are plain.
#[derive(Debug, Clone)]
pub(crate) enum Block {
    /// The answer in one sentence.
    Headline(String),
    Paragraph(String),
    /// A heading inside a section.
    Heading(String),
    List(Vec<String>),
    /// Lines for copying.
    Code(String),
    /// Reasons to doubt the result.
    Doubts(Vec<Warning>),
    Table(TableBlock),
    /// A table of shaded cells; pages only.
    Matrix(Matrix),
    /// Pages only.
    Picture(Picture),
    /// Secondary blocks below a summary, unfolded in print; pages only.
    Folded(String, Vec<Block>),
}

/// A table; the first cell of a row names it.
#[derive(Debug, Clone, Default)]
pub(crate) struct TableBlock {
    /// Empty where the heading above says it.
    pub caption: String,
    pub head: Vec<(String, Column)>,
    pub rows: Vec<Vec<String>>,
}

/// Kind of a column: texts begin at the left, numbers end at the right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Column {
    Text,
    Number,
}

/// A picture with its caption.
#[derive(Debug, Clone)]
pub(crate) struct Picture {
    pub svg: String,
    pub caption: String,
}

/// Shaded cells with names of rows and columns.
#[derive(Debug, Clone)]
pub(crate) struct Matrix {
    /// Empty where the heading above says it.
    pub caption: String,
    pub head: Vec<String>,
    /// Name and cells of each row; `None` is empty.
    pub rows: Vec<(String, Vec<Option<Shade>>)>,
}

/// A cell of a matrix.
#[derive(Debug, Clone)]
pub(crate) struct Shade {
    pub text: String,
    /// Darkness, 0 to 1.
    pub weight: f64,
    /// Framed and bold.
    pub right: bool,
}

impl Section {
    /// A section of pages; the terminal leaves it out.
    pub fn new(id: &'static str, title: &'static str, rest: Vec<Block>) -> Self {
        let brief = vec![];
        Self {
            id,
            title,
            brief,
            rest,
        }
    }

    /// The same with blocks that the terminal shows, too.
    pub fn brief(self, brief: Vec<Block>) -> Self {
        Self { brief, ..self }
    }
}

impl Block {
    pub fn paragraph(text: impl Into<String>) -> Self {
        Self::Paragraph(text.into())
    }

    pub fn picture(svg: String, caption: impl Into<String>) -> Self {
        let caption = caption.into();
        Self::Picture(Picture { svg, caption })
    }

    pub fn folded(summary: impl Into<String>, blocks: Vec<Self>) -> Self {
        Self::Folded(summary.into(), blocks)
    }

    /// A table with the names and kinds of its columns.
    pub fn table(
        caption: impl Into<String>,
        head: &[(&str, Column)],
        rows: Vec<Vec<String>>,
    ) -> Self {
        let head = head.iter().map(|(name, kind)| ((*name).to_owned(), *kind));
        Self::Table(TableBlock {
            caption: caption.into(),
            head: head.collect(),
            rows,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn document() -> Document {
        let table = Block::table(
            "Two rows.",
            &[("name", Column::Text), ("x", Column::Number)],
            vec![
                vec!["a<b".into(), "1.25".into()],
                vec!["c".into(), "10".into()],
            ],
        );
        let doubt = Warning {
            code: "still",
            what: "the input u never changes".into(),
            remedy: "take another record",
        };
        let hidden = Block::folded("More", vec![Block::paragraph("deep")]);
        Document {
            title: "T & U".into(),
            byline: "R.csv".into(),
            answer: vec![
                Block::Headline("No gap.".into()),
                Block::Doubts(vec![doubt]),
            ],
            picture: None,
            sections: vec![Section::new("s", "S", vec![hidden]).brief(vec![table])],
            footer: vec!["call".into()],
        }
    }

    #[test]
    fn the_terminal_shows_the_answer_and_what_is_brief() {
        assert_eq!(
            document().text(),
            "No gap.\nWarning: the input u never changes; take another record.\n\nTwo rows.\nname      x\na<b    1.25\nc        10\n"
        );
    }

    #[test]
    fn a_page_shows_everything_as_text() {
        let page = document().html();
        for part in [
            "<title>T &amp; U</title>",
            "<p class=\"byline\">R.csv</p>",
            "<p class=\"verdict\">No gap.</p>",
            "<th scope=\"row\">a&lt;b</th><td class=\"n\">1.25</td>",
            "<summary>More</summary>\n<p>deep</p>",
            "<footer><p>call</p></footer>",
            "<a href=\"#s\">S</a>",
        ] {
            assert!(page.contains(part), "{part}: {page}");
        }
    }

    #[test]
    fn a_table_without_a_caption_is_heard_with_its_heading() {
        let table = || Block::table("", &[("name", Column::Text)], vec![]);
        let rest = vec![
            table(),
            Block::Heading("H".into()),
            table(),
            Block::folded("F", vec![table()]),
        ];
        let document = Document {
            title: "T".into(),
            answer: vec![table()],
            sections: vec![Section::new("s", "S", rest)],
            ..Document::default()
        };
        let page = document.html();
        let captions: Vec<&str> = (page.split("<caption class=\"heard\">").skip(1))
            .map(|rest| rest.split('<').next().unwrap())
            .collect();
        assert_eq!(captions, ["T", "S", "H", "F"]);
    }
}
