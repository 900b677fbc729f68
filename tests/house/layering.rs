//! Modules depend downward only: a module uses those that stand above it in `src/lib.rs`'s list.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// The layers of docs/architecture.md, lowest first; within a layer, in order.
const LAYERS: [&[&str]; 6] = [
    &["setting", "math", "progress", "storage"],
    &["record", "twin", "twins", "effect"],
    &["fit", "likelihood", "feature", "network"],
    &["study", "external", "estimator", "diagnose"],
    &["evaluate", "report"],
    &["cli", "prelude"],
];

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// Modules named as `crate::x` in code, also in `use crate::{x, y::z}`.
fn uses(text: &str) -> Vec<String> {
    let code: String = (text.lines())
        .map(|line| line.split("//").next().unwrap_or("").trim_end())
        .collect::<Vec<_>>()
        .join("\n");
    let word = |s: &str| {
        s.chars()
            .take_while(|c| c.is_alphanumeric() || *c == '_')
            .collect()
    };
    let mut found = Vec::new();
    for (at, _) in code.match_indices("crate::") {
        let rest = code[at + "crate::".len()..].trim_start();
        match rest.strip_prefix('{') {
            None => found.push(word(rest)),
            Some(list) => {
                let (mut depth, mut item) = (0, String::new());
                for c in list.chars() {
                    match c {
                        '{' => depth += 1,
                        '}' if depth == 0 => break,
                        '}' => depth -= 1,
                        ',' if depth == 0 => found.push(word(std::mem::take(&mut item).trim())),
                        _ => {}
                    }
                    if c != ',' && depth == 0 {
                        item.push(c);
                    }
                }
                found.push(word(item.trim()));
            }
        }
    }
    found.retain(|m: &String| !m.is_empty());
    found
}

#[test]
fn modules_depend_downward_only() {
    let order: BTreeMap<&str, usize> = LAYERS.iter().copied().flatten().copied().zip(0..).collect();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&root, &mut files);
    let mut wrong = Vec::new();
    let mut checked = 0;
    for path in files {
        let inside = path.strip_prefix(&root).unwrap();
        let first = inside
            .components()
            .next()
            .unwrap()
            .as_os_str()
            .to_str()
            .unwrap();
        let module = first.trim_end_matches(".rs");
        if matches!(module, "lib" | "main" | "book") {
            continue;
        }
        let here = *order
            .get(module)
            .unwrap_or_else(|| panic!("{module} has no layer"));
        for used in uses(&fs::read_to_string(&path).unwrap()) {
            let there = *order
                .get(used.as_str())
                .unwrap_or_else(|| panic!("{}: crate::{used} has no layer", inside.display()));
            checked += 1;
            if there > here {
                wrong.push(format!("{} uses crate::{used}", inside.display()));
            }
        }
    }
    assert!(checked > 100, "only {checked} uses were seen");
    assert!(
        wrong.is_empty(),
        "upward dependencies:\n{}",
        wrong.join("\n")
    );
}

#[test]
fn grouped_uses_are_seen() {
    let text = "use crate::{twin::{A, B}, math::C};\n// crate::cli\nlet x = crate::gate::G;";
    assert_eq!(uses(text), ["twin", "math", "gate"]);
}

/// Only `network` names dfdx, only `optimise` argmin, only `external/fmu` fmi: each can be replaced in one place.
#[test]
fn large_dependencies_have_one_room() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&root, &mut files);
    for (library, room) in [
        ("dfdx::", "network"),
        ("argmin::", "fit"),
        ("fmi::", "external/fmu"),
    ] {
        for path in &files {
            let code: String = (fs::read_to_string(path).unwrap().lines())
                .map(|l| l.split("//").next().unwrap_or("").to_owned() + "\n")
                .collect();
            let inside = path.strip_prefix(&root).unwrap();
            assert!(
                !code.contains(library) || inside.starts_with(room),
                "{} names {library}",
                inside.display()
            );
        }
    }
}
