//! The book's contents.

use super::{OUTSIDE, Piece, pages, pieces, read, root};
use std::collections::BTreeSet;

/// The table of contents lists every page, once, and no other.
#[test]
fn every_page_is_listed() {
    let summary = read(&root().join("docs/SUMMARY.md"));
    let listed: Vec<&str> = (summary.split("](").skip(1))
        .map(|rest| rest.split(')').next().unwrap())
        .collect();
    let once: BTreeSet<&str> = listed.iter().copied().collect();
    assert_eq!(once.len(), listed.len(), "a page is listed twice");
    let there: BTreeSet<String> = (pages().iter())
        .map(|page| page.file_name().unwrap().to_str().unwrap().to_owned())
        .filter(|name| !OUTSIDE.contains(&name.as_str()) && name != "SUMMARY.md")
        .collect();
    assert_eq!(once, there.iter().map(String::as_str).collect());
}

/// The book stays short: few pages, few terms.
#[test]
fn the_book_is_short() {
    let book = pages().len() - OUTSIDE.len() - 1; // without SUMMARY
    assert!(book <= 19, "{book} pages");
    let glossary = read(&root().join("docs/glossary.md"));
    let terms = glossary.lines().filter(|line| line.starts_with("| **"));
    assert!(terms.count() <= 40);
    let contributing = read(&root().join("CONTRIBUTING.md"));
    assert!(contributing.lines().count() <= 120);
}

/// Rust of the pages is compiled: as a doctest, or as the example that the page includes.
#[test]
fn code_is_compiled() {
    let doctests = read(&root().join("src/book.rs"));
    let mut checked = 0;
    for page in pages() {
        let name = page.file_name().unwrap().to_str().unwrap();
        for piece in pieces(&read(&page)) {
            let Piece::Block { language, text } = piece else {
                continue;
            };
            if language == "rust,ignore" {
                assert!(
                    text.starts_with("{{#include ../examples/"),
                    "{name}: {text}"
                );
            } else if language.starts_with("rust") && name != "README.md" {
                assert!(
                    doctests.contains(&format!("\"../docs/{name}\"")),
                    "{name} in src/book.rs"
                );
            }
            if let Some(include) = text.trim().strip_prefix("{{#include ../") {
                let file = include.trim_end_matches("}}").split(':').next().unwrap();
                assert!(root().join(file).exists(), "{name} includes {file}");
                checked += 1;
            }
        }
    }
    assert!(checked > 5);
}
