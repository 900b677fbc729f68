//! Metadata of the package: what it holds, and facts that several files state.

use crate::source::root;
use std::fs;

fn file(name: &str) -> String {
    fs::read_to_string(root().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn manifest() -> toml::Table {
    toml::from_str(&file("Cargo.toml")).unwrap()
}

/// A text of `[package]`.
fn package(key: &str) -> String {
    manifest()["package"][key].as_str().unwrap().to_owned()
}

fn words(list: &toml::Value) -> Vec<String> {
    let words = list.as_array().unwrap().iter();
    words
        .map(|word| word.as_str().unwrap().to_owned())
        .collect()
}

/// The package leaves out what only this repository needs, and ships what doctests and users read.
#[test]
fn the_package_leaves_the_tests_out() {
    let excluded = words(&manifest()["package"]["exclude"]);
    for path in &excluded {
        assert!(root().join(path).exists(), "exclude names {path}");
    }
    let is_out = |path: &str| {
        excluded
            .iter()
            .any(|folder| path.starts_with(folder.as_str()))
    };
    for path in [
        "fuzz/Cargo.toml",
        ".ci/run",
        "python/pyproject.toml",
        "tests/house/main.rs",
    ] {
        assert!(is_out(path), "{path}");
    }
    for path in [
        "README.md",
        "docs/estimating.md",
        "tests/contract/gap.schema.json",
    ] {
        assert!(!is_out(path) && root().join(path).exists(), "{path}");
    }
}

/// docs.rs has no MPI and no libclang.
#[test]
fn the_documentation_builds_without_system_libraries() {
    let manifest = manifest();
    let features = words(&manifest["package"]["metadata"]["docs"]["rs"]["features"]);
    let known = manifest["features"].as_table().unwrap();
    assert!(features.iter().all(|feature| known.contains_key(feature)));
    assert!(
        features
            .iter()
            .all(|feature| feature != "fmi" && feature != "mpi")
    );
}

/// Pages that name the oldest Rust name that of Cargo.toml.
#[test]
fn the_oldest_rust_is_the_same_everywhere() {
    let rust = package("rust-version");
    for name in ["README.md", "docs/quick-start.md"] {
        let text = file(name);
        let named = text.split("Rust 1.").nth(1).expect(name);
        let minor: String = named.chars().take_while(char::is_ascii_digit).collect();
        assert_eq!(format!("1.{minor}"), rust, "{name}");
    }
}

/// CITATION.cff repeats version, licences and description of the package.
#[test]
fn the_citation_is_of_this_version() {
    let text = file("CITATION.cff");
    let has = |line: &str| text.lines().any(|l| l.trim() == line);
    assert!(has(&format!("version: {}", package("version"))));
    for licence in package("license").split(" OR ") {
        assert!(has(&format!("- {licence}")), "{licence}");
    }
    assert!(
        text.to_lowercase()
            .contains(&package("description").to_lowercase())
    );
}

/// Actions of others are pinned by commit: a tag can be moved.
#[test]
fn actions_are_pinned() {
    let text = file(".github/workflows/ci.yml");
    let uses: Vec<&str> = text.split("uses: ").skip(1).collect();
    assert!(!uses.is_empty());
    for action in uses {
        let (_, commit) = action.split_once('@').expect("name@commit");
        let commit: String = commit.chars().take_while(|c| !c.is_whitespace()).collect();
        assert!(
            commit.len() == 40 && commit.chars().all(|c| c.is_ascii_hexdigit()),
            "{commit}"
        );
    }
    assert!(text.contains("run: .ci/run"));
}
