//! Links lead somewhere.

use super::{Piece, pages, pieces, prose, read, root};
use std::path::Path;

/// Headings as addresses, the way mdBook and code forges write them.
fn anchors(text: &str) -> Vec<String> {
    let mut anchors: Vec<String> = vec![];
    for piece in pieces(text) {
        let Piece::Prose(text) = piece else { continue };
        for line in text.lines().filter(|line| line.starts_with('#')) {
            let heading = line.trim_start_matches('#').trim();
            let anchor: String = (heading.chars())
                .filter_map(|c| match c {
                    ' ' => Some('-'),
                    c if c.is_alphanumeric() || c == '-' || c == '_' => {
                        Some(c.to_lowercase().next().unwrap())
                    }
                    _ => None,
                })
                .collect();
            anchors.push(anchor);
        }
    }
    anchors
}

#[test]
fn anchors_are_written_as_mdbook_does() {
    let text = "# The gate\n## Job arrays: `--shard i/n`\n```text\n# no heading\n```\n## Beyond the paper's table\n";
    assert_eq!(
        anchors(text),
        [
            "the-gate",
            "job-arrays---shard-in",
            "beyond-the-papers-table"
        ]
    );
}

/// Targets of the links and pictures of a page; brackets in code are none.
fn targets(text: &str) -> Vec<String> {
    let (words, _) = prose(text);
    (words.split("](").skip(1))
        .map(|rest| rest.split(')').next().unwrap().to_owned())
        .filter(|target| !target.starts_with("http"))
        .collect()
}

fn check(page: &Path, target: &str) -> Result<(), String> {
    let name = page.file_name().unwrap().to_str().unwrap();
    let (path, anchor) = target.split_once('#').unwrap_or((target, ""));
    if name != "README.md" && path.starts_with("..") {
        return Err(format!(
            "{name}: {target} leaves the book; name the file, or include it"
        ));
    }
    let file = match path {
        "" => page.to_owned(),
        path => page.parent().unwrap().join(path),
    };
    if !file.exists() {
        return Err(format!("{name}: {target} is not there"));
    }
    let known = || anchors(&read(&file));
    if !anchor.is_empty() && !known().iter().any(|known| known == anchor) {
        return Err(format!(
            "{name}: {target}; there are {}",
            known().join(", ")
        ));
    }
    Ok(())
}

#[test]
fn links_lead_somewhere() {
    let (mut links, mut broken) = (0, vec![]);
    for page in pages() {
        for target in targets(&read(&page)) {
            links += 1;
            broken.extend(check(&page, &target).err());
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
    assert!(links > 100, "{links}");
}

#[test]
fn a_broken_link_is_seen() {
    let page = root().join("docs/introduction.md");
    assert!(check(&page, "method.md#3-gate").is_ok());
    assert!(check(&page, "method.md#3-gat").is_err());
    assert!(check(&page, "methods.md").is_err());
    assert!(check(&page, "../README.md").is_err());
}
