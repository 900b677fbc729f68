//! The template of a twin; links and calls of the README are tested with the book's (`tests/house/book`).

use std::fs;
use std::path::Path;

fn file(name: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).unwrap()
}

/// The twin of the page on adding one is the template, which the compiler and `.ci/run` see; the README names it.
#[test]
fn the_code_is_the_template() {
    let page = file("docs/add-a-twin.md");
    let code = page.split("```rust,no_run\n").nth(1).unwrap();
    let code = code.split("```").next().unwrap();
    let template = file("examples/own_twin.rs");
    assert_eq!(code, template);
    assert!(template.lines().count() < 60, "short enough to be read");
    assert!(file("README.md").contains("(examples/own_twin.rs)"));
}

#[test]
fn the_readme_is_short() {
    let lines = file("README.md").lines().count();
    assert!(lines <= 120, "{lines} lines");
}
