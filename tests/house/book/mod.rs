//! The pages of `docs/`, the README and CONTRIBUTING say what is there: pages, links, calls, messages, and the quick start as it is printed.

mod calls;
mod links;
mod messages;
mod pages;
mod quick_start;

use std::fs;
use std::path::{Path, PathBuf};

/// The folder of the crate.
fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Pages outside the book.
const OUTSIDE: [&str; 2] = ["CONTRIBUTING.md", "README.md"];

/// Every page: those of `docs/`, and those outside the book.
fn pages() -> Vec<PathBuf> {
    let entries = fs::read_dir(root().join("docs")).unwrap();
    let mut pages: Vec<PathBuf> = entries
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "md"))
        .collect();
    pages.extend(OUTSIDE.map(|name| root().join(name)));
    pages.sort();
    assert!(pages.len() > 10);
    pages
}

/// A page in pieces: prose, and fenced blocks with the word behind the fence.
enum Piece {
    Prose(String),
    Block { language: String, text: String },
}

fn pieces(text: &str) -> Vec<Piece> {
    let mut pieces = vec![Piece::Prose(String::new())];
    for line in text.lines() {
        let fence = line.trim_start().strip_prefix("```");
        match (pieces.last_mut().unwrap(), fence) {
            (Piece::Prose(_), Some(language)) => pieces.push(Piece::Block {
                language: language.into(),
                text: String::new(),
            }),
            (Piece::Block { .. }, Some(_)) => pieces.push(Piece::Prose(String::new())),
            (Piece::Prose(text) | Piece::Block { text, .. }, None) => {
                text.push_str(line);
                text.push('\n');
            }
        }
    }
    pieces
}

/// The prose of a page without its code, and the inline code.
fn prose(text: &str) -> (String, Vec<String>) {
    let (mut words, mut code) = (String::new(), vec![]);
    for piece in pieces(text) {
        let Piece::Prose(text) = piece else { continue };
        // A span ends with its paragraph, or the row of its table.
        let mut paragraphs: Vec<String> = vec![String::new()];
        for line in text.lines() {
            if line.trim().is_empty() || line.starts_with('|') || line.starts_with('#') {
                paragraphs.push(String::new());
            }
            let paragraph = paragraphs.last_mut().unwrap();
            paragraph.push_str(line);
            paragraph.push('\n');
        }
        for paragraph in paragraphs {
            let parts: Vec<&str> = paragraph.split('`').collect();
            assert!(parts.len() % 2 == 1, "a ` without its partner: {paragraph}");
            for (i, part) in parts.iter().enumerate() {
                match i % 2 {
                    0 => words.push_str(part),
                    _ => code.push(part.split_whitespace().collect::<Vec<_>>().join(" ")),
                }
            }
        }
    }
    (words, code)
}
