//! Every public function, struct, enum and trait has an example of its own, or is named by the example of its module.
//!
//! Reads the sources, so that it needs no other tool than the tests do. Methods, fields and variants are not asked for: theirs
//! is the example of their type.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// A public item at the root of a module.
#[derive(Debug, PartialEq)]
struct Item {
    kind: String,
    name: String,
    /// The code of the examples in its documentation.
    example: String,
}

/// The code between fences of documentation, of those blocks that the compiler sees.
fn code(documentation: &[&str]) -> String {
    let (mut found, mut inside, mut seen) = (String::new(), false, false);
    for line in documentation {
        let line = line.strip_prefix(' ').unwrap_or(line);
        match line.strip_prefix("```") {
            Some(_) if inside => inside = false,
            Some(language) => {
                inside = true;
                seen = ["", "rust", "no_run", "rust,no_run", "should_panic"].contains(&language);
            }
            None if inside && seen => found.extend([line, "\n"]),
            None => {}
        }
    }
    found
}

/// Whether `name` stands in `text` as a word.
fn names(text: &str, name: &str) -> bool {
    let inside = |c: char| c.is_alphanumeric() || c == '_';
    text.match_indices(name).any(|(at, _)| {
        !text[..at].ends_with(inside) && !text[at + name.len()..].starts_with(inside)
    })
}

/// Code of the module's own documentation.
fn module_example(text: &str) -> String {
    let lines: Vec<&str> = (text.lines())
        .filter_map(|line| line.strip_prefix("//!"))
        .collect();
    code(&lines)
}

/// What a line at the left margin declares to the outside.
fn declared(line: &str) -> Option<(&str, &str)> {
    let rest = line.strip_prefix("pub ")?;
    let rest = rest.strip_prefix("const ").unwrap_or(rest);
    let (kind, rest) = rest.split_once(' ')?;
    let end = rest
        .find(|c: char| !c.is_alphanumeric() && c != '_')
        .unwrap_or(rest.len());
    ["fn", "struct", "enum", "trait"]
        .contains(&kind)
        .then_some((kind, &rest[..end]))
}

/// Items that a file declares `pub` at its root.
fn items(text: &str) -> Vec<Item> {
    let (mut found, mut documentation) = (Vec::new(), Vec::new());
    let mut attribute = false;
    for line in text.lines() {
        if let Some(more) = line.strip_prefix("///") {
            documentation.push(more);
        } else if attribute || line.starts_with("#[") {
            attribute = !line.ends_with(']');
        } else {
            if let Some((kind, name)) = declared(line) {
                found.push(Item {
                    kind: kind.into(),
                    name: name.into(),
                    example: code(&documentation),
                });
            }
            documentation.clear();
        }
    }
    found
}

/// Names that a module hands on from its own files: `pub use inner::{A, B};`.
fn handed_on(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    for statement in text.split("\npub use ").skip(1) {
        let statement = statement.split(';').next().unwrap_or_default();
        if statement.starts_with("crate::") {
            continue; // counted at home
        }
        let list = statement.rsplit("::").next().unwrap_or_default();
        let list = list.trim_matches(|c: char| "{}".contains(c) || c.is_whitespace());
        found.extend(list.split(',').map(|name| name.trim().to_owned()));
    }
    found.retain(|name| !name.is_empty());
    found
}

/// `pub mod x;` of a module, unless its documentation is hidden.
fn public_modules(text: &str) -> Vec<&str> {
    let lines: Vec<&str> = text.lines().collect();
    let before = std::iter::once("").chain(lines.iter().copied());
    (lines.iter().zip(before))
        .filter(|(_, before)| *before != "#[doc(hidden)]")
        .filter_map(|(line, _)| line.strip_prefix("pub mod ")?.strip_suffix(';'))
        .collect()
}

fn sources(folder: &Path, found: &mut BTreeMap<PathBuf, String>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            let text = fs::read_to_string(&path).unwrap();
            found.insert(path, text);
        }
    }
}

/// What lacks an example in the module whose files lie at `place`, and in public modules below it; how many items there are.
fn lacking(
    place: &Path,
    path: &str,
    all: &BTreeMap<PathBuf, String>,
    without: &mut Vec<String>,
) -> usize {
    let folder = place.to_owned();
    let file = [folder.join("mod.rs"), folder.with_extension("rs")]
        .into_iter()
        .find(|file| all.contains_key(file))
        .unwrap_or_else(|| panic!("{path} has no file"));
    let text = &all[&file];
    let of_module = module_example(text);
    let mut count = 0;
    let mut ask = |item: &Item| {
        if item.example.is_empty() && !names(&of_module, &item.name) {
            without.push(format!("{} {path}::{}", item.kind, item.name));
        }
        count += 1;
    };
    for item in items(text) {
        ask(&item);
    }
    for name in handed_on(text) {
        for (_, inner) in all
            .iter()
            .filter(|(p, _)| p.starts_with(&folder) && **p != file)
        {
            if let Some(item) = items(inner).iter().find(|item| item.name == name) {
                ask(item);
                break;
            }
        }
    }
    for module in public_modules(text) {
        count += lacking(
            &folder.join(module),
            &format!("{path}::{module}"),
            all,
            without,
        );
    }
    count
}

#[test]
fn public_items_have_examples() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut all = BTreeMap::new();
    sources(&root, &mut all);
    let library = &all[&root.join("lib.rs")];
    let (mut without, mut count) = (Vec::new(), 0);
    for module in public_modules(library) {
        count += lacking(&root.join(module), module, &all, &mut without);
    }
    println!("{count} public items, {} without an example", without.len());
    assert!(count > 200, "only {count} public items were seen");
    assert!(
        without.is_empty(),
        "{} of {count} public items have no example, and their module's example does not name them:\n{}",
        without.len(),
        without.join("\n")
    );
}

/// The reader sees what has an example, what has none, and what is not asked for.
#[test]
fn a_bare_item_is_seen() {
    let text = "//! ```\n//! let a = Named::new();\n//! ```\n\n\
                /// ```\n/// let own = 1;\n/// ```\n#[derive(\n    Debug,\n)]\npub struct Own;\n\n\
                /// Text.\n///\n/// ```text\n/// Bare\n/// ```\npub enum Bare {}\n\n\
                pub(crate) fn hidden() {}\n\npub fn Named() {}\n";
    let found = items(text);
    let said: Vec<_> = (found.iter())
        .map(|item| (item.name.as_str(), item.example.as_str()))
        .collect();
    assert_eq!(
        said,
        [("Own", "let own = 1;\n"), ("Bare", ""), ("Named", "")]
    );
    assert!(names(&module_example(text), "Named") && !names(&module_example(text), "Name"));
    assert_eq!(
        handed_on(
            "\npub use a::{B,\n    C};\npub use d::E;\npub(crate) use f::G;\npub use crate::h::I;\n"
        ),
        ["B", "C", "E"]
    );
}
