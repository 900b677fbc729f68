//! Links lead somewhere.

use super::{OUTSIDE, Piece, pages, pieces, prose, read, root};
use std::path::{Path, PathBuf};

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
    if !OUTSIDE.contains(&name) && path.starts_with("..") {
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

/// Counts the files and folders that a text names in code, and lists those that are missing.
///
/// A path starts at the root, below `src/` in the page on the architecture, or at the folder of the path before it in the
/// line, or at that folder's parent.
fn missing_paths(page: &Path, text: &str) -> (usize, Vec<String>) {
    let name = page.file_name().unwrap().to_str().unwrap();
    let below = match name {
        "architecture.md" => root().join("src"),
        _ => root().to_owned(),
    };
    let (mut named, mut missing) = (0, vec![]);
    for line in text.lines() {
        let mut beside: Option<PathBuf> = None;
        for code in line.split('`').skip(1).step_by(2) {
            let is_file = [".rs", ".md", ".toml", ".json", ".yml", ".txt"]
                .iter()
                .any(|ending| code.ends_with(ending));
            let rooted = [
                "src/",
                "tests/",
                "docs/",
                "examples/",
                "benches/",
                ".github/",
                ".ci/",
            ]
            .iter()
            .any(|start| code.starts_with(start));
            let plain = |c: char| c.is_alphanumeric() || "_-./".contains(c);
            if !(is_file || rooted || code.ends_with('/')) || !code.chars().all(plain) {
                continue;
            }
            named += 1;
            let places = [
                Some(root().join(code)),
                Some(below.join(code)),
                beside.as_ref().map(|folder| folder.join(code)),
                (beside.as_ref()).and_then(|folder| Some(folder.parent()?.join(code))),
            ];
            match places.into_iter().flatten().find(|place| place.exists()) {
                Some(place) if place.is_dir() => beside = Some(place),
                Some(place) => beside = place.parent().map(Path::to_owned),
                None => missing.push(format!("{name}: {code} is not there")),
            }
        }
    }
    (named, missing)
}

#[test]
fn named_files_are_there() {
    for (page, least) in [("CONTRIBUTING.md", 30), ("docs/architecture.md", 40)] {
        let page = root().join(page);
        let (named, missing) = missing_paths(&page, &read(&page));
        assert!(missing.is_empty(), "{}", missing.join("\n"));
        assert!(named > least, "{}: {named} paths", page.display());
    }
}

#[test]
fn a_missing_file_is_seen() {
    let missing = |name: &str, text| missing_paths(&root().join(name), text).1.len();
    assert_eq!(missing("CONTRIBUTING.md", "`src/lib.rs`, `main.rs`"), 0);
    assert_eq!(missing("CONTRIBUTING.md", "`src/library.rs`"), 1);
    assert_eq!(missing("CONTRIBUTING.md", "`src/lib.rs`, `mian.rs`"), 1);
    assert_eq!(missing("CONTRIBUTING.md", "`twins/mod.rs`"), 1);
    assert_eq!(missing("docs/architecture.md", "`twins/mod.rs`"), 0);
}
