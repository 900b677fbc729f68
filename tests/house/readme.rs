//! Code of the README; its links and calls are tested with the book's (`tests/house/book`).

use std::fs;
use std::path::Path;

fn file(name: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).unwrap()
}

/// The README's twin is the template, which the compiler and `.ci/run` see.
#[test]
fn the_code_is_the_template() {
    let readme = file("README.md");
    let code = readme.split("```rust,no_run\n").nth(1).unwrap();
    let code = code.split("```").next().unwrap();
    let template = file("examples/own_twin.rs");
    assert_eq!(code, template);
    assert!(template.lines().count() < 60, "short enough to be read");
}
