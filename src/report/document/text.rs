//! Documents on the terminal.

use super::{Block, Column, Document, TableBlock};

/// Columns of a line of text; a table may be wider.
const COLUMNS: usize = 100;
/// Between columns of a table.
const GAP: &str = "   ";

impl Document {
    /// The answer and the brief part of each section, with an empty line around tables.
    pub fn text(&self) -> String {
        let brief = self.sections.iter().flat_map(|section| &section.brief);
        let mut parts: Vec<(bool, String)> = (self.answer.iter().chain(brief))
            .map(|block| (matches!(block, Block::Table(_)), block.text()))
            .collect();
        parts.retain(|(_, text)| !text.is_empty());
        let mut text = String::new();
        for (i, (is_table, part)) in parts.iter().enumerate() {
            if i > 0 && (*is_table || parts[i - 1].0) {
                text.push('\n');
            }
            text.push_str(part);
        }
        text
    }
}

impl Block {
    /// Lines of a block, each with its end; none of what only pages show.
    fn text(&self) -> String {
        match self {
            Self::Headline(text) | Self::Paragraph(text) | Self::Heading(text) => wrapped(text, ""),
            Self::List(items) => items.iter().map(|item| wrapped(item, "  ")).collect(),
            Self::Code(text) => text.lines().map(|line| format!("{line}\n")).collect(),
            Self::Doubts(all) => (all.iter())
                .map(|doubt| wrapped(&format!("Warning: {}; {}.", doubt.what, doubt.remedy), ""))
                .collect(),
            Self::Table(table) => table.text(),
            Self::Matrix(_) | Self::Picture(_) | Self::Folded(..) => String::new(),
        }
    }
}

impl TableBlock {
    /// Caption, head and rows as lines.
    pub fn text(&self) -> String {
        let head: Vec<String> = self.head.iter().map(|(name, _)| name.clone()).collect();
        let rows = || std::iter::once(&head).chain(&self.rows);
        let length = |row: &Vec<String>, j: usize| row.get(j).map_or(0, |c| c.chars().count());
        let widths: Vec<usize> = (0..head.len())
            .map(|j| rows().map(|row| length(row, j)).max().unwrap_or(0))
            .collect();
        let mut text = wrapped(&self.caption, "");
        for row in rows() {
            let cells: Vec<String> = (row.iter().zip(&widths).zip(&self.head))
                .map(|((cell, &width), (_, kind))| match kind {
                    Column::Text => format!("{cell:<width$}"),
                    Column::Number => format!("{cell:>width$}"),
                })
                .collect();
            text.push_str(cells.join(GAP).trim_end());
            text.push('\n');
        }
        text
    }
}

/// Text in lines of at most [`COLUMNS`] columns, where words allow it; `indent` before each.
fn wrapped(text: &str, indent: &str) -> String {
    let mut lines: Vec<String> = vec![];
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= COLUMNS => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(format!("{indent}{word}")),
        }
    }
    lines.iter().map(|line| format!("{line}\n")).collect()
}
