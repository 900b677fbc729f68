//! Dependencies: licences of deny.toml alone, and crates.io alone. Needs nothing but cargo; `cargo deny check` says more.

use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

const REGISTRY: &str = "registry+https://github.com/rust-lang/crates.io-index";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The licences that deny.toml allows.
fn allowed() -> Vec<String> {
    let text = std::fs::read_to_string(root().join("deny.toml")).unwrap();
    let file: toml::Table = toml::from_str(&text).unwrap();
    let list = file["licenses"]["allow"].as_array().unwrap();
    list.iter()
        .map(|id| id.as_str().unwrap().to_owned())
        .collect()
}

/// Returns true if an SPDX expression can be met with these licences.
fn met(expression: &str, allowed: &[String]) -> bool {
    // Older crates write a slash for OR.
    let spaced = (expression.replace('/', " OR "))
        .replace('(', " ( ")
        .replace(')', " ) ");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let mut rest = words.as_slice();
    any(&mut rest, allowed) && rest.is_empty()
}

/// Terms with OR between them: the weakest of SPDX's operators.
fn any(rest: &mut &[&str], allowed: &[String]) -> bool {
    let mut found = all(rest, allowed);
    while rest.first() == Some(&"OR") {
        *rest = &rest[1..];
        found |= all(rest, allowed);
    }
    found
}

fn all(rest: &mut &[&str], allowed: &[String]) -> bool {
    let mut found = one(rest, allowed);
    while rest.first() == Some(&"AND") {
        *rest = &rest[1..];
        found &= one(rest, allowed);
    }
    found
}

fn one(rest: &mut &[&str], allowed: &[String]) -> bool {
    let Some((first, after)) = rest.split_first() else {
        return false;
    };
    *rest = after;
    if *first == "(" {
        let found = any(rest, allowed);
        let closed = rest.first() == Some(&")");
        *rest = rest.get(1..).unwrap_or_default();
        return found && closed;
    }
    let name = match rest {
        ["WITH", exception, after @ ..] => {
            let name = format!("{first} WITH {exception}");
            *rest = after;
            name
        }
        _ => (*first).to_owned(),
    };
    allowed.contains(&name)
}

/// Every package of every feature; without a network, those of this build.
fn packages() -> Vec<Value> {
    let metadata = |more: &[&str]| {
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let output = Command::new(cargo)
            .current_dir(root())
            .args(["metadata", "--format-version", "1", "--locked"])
            .args(more)
            .output()
            .expect("cargo runs");
        let found = output
            .status
            .success()
            .then(|| serde_json::from_slice(&output.stdout).unwrap());
        found.ok_or_else(|| String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let version = Command::new("rustc")
        .arg("-vV")
        .output()
        .expect("rustc runs");
    let version = String::from_utf8(version.stdout).unwrap();
    let host = version
        .lines()
        .find_map(|line| line.strip_prefix("host: "))
        .unwrap();
    let whole = metadata(&["--all-features"]);
    let found: Value = whole
        .or_else(|error: String| {
            eprintln!("not all features can be looked at: {}", error.trim());
            metadata(&["--offline", "--filter-platform", host])
        })
        .unwrap();
    found["packages"].as_array().unwrap().clone()
}

#[test]
fn licences_are_those_of_deny_toml() {
    let allowed = allowed();
    assert!(allowed.iter().any(|id| id == "MIT"));
    let packages = packages();
    assert!(packages.len() > 100, "{} packages", packages.len());
    let wrong: Vec<String> = (packages.iter())
        .filter(|p| {
            !p["license"]
                .as_str()
                .is_some_and(|license| met(license, &allowed))
        })
        .map(|p| format!("{} {}: {}", p["name"], p["version"], p["license"]))
        .collect();
    assert!(
        wrong.is_empty(),
        "licences that deny.toml does not allow:\n{}",
        wrong.join("\n")
    );
}

/// Crates that a program builds which embeds the library without its command line.
#[cfg(target_os = "linux")]
#[test]
fn an_embedding_program_builds_few_crates() {
    const MOST: usize = 120;
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .current_dir(root())
        .args(["tree", "--locked", "--offline", "--edges", "normal"])
        .args([
            "--no-default-features",
            "--prefix",
            "none",
            "--format",
            "{p}",
        ])
        .output()
        .expect("cargo runs");
    let text = String::from_utf8(output.stdout).unwrap();
    let crates: BTreeSet<Vec<&str>> = (text.lines())
        .map(|line| line.split(' ').take(2).collect())
        .filter(|name: &Vec<&str>| name[0] != "truetwin")
        .collect();
    println!("{} crates of at most {MOST}", crates.len());
    assert!((50..=MOST).contains(&crates.len()), "{crates:?}");
}

/// Cargo.lock names every package, whatever the features and the platform.
#[test]
fn everything_is_from_crates_io() {
    let text = std::fs::read_to_string(root().join("Cargo.lock")).unwrap();
    let lock: toml::Table = toml::from_str(&text).unwrap();
    for package in lock["package"].as_array().unwrap() {
        let (name, source) = (
            package["name"].as_str(),
            package.get("source").and_then(|s| s.as_str()),
        );
        match source {
            None => assert_eq!(name, Some("truetwin"), "a package of no registry"),
            Some(source) => {
                assert_eq!(source, REGISTRY, "{name:?}");
                assert!(
                    package.get("checksum").is_some(),
                    "{name:?} has no checksum"
                );
            }
        }
    }
}

#[test]
fn expressions_are_understood() {
    let allowed: Vec<String> = ["MIT", "Apache-2.0 WITH LLVM-exception", "Unicode-3.0"]
        .map(Into::into)
        .into();
    for (expression, right) in [
        ("MIT", true),
        ("GPL-3.0", false),
        ("MIT OR GPL-3.0", true),
        ("Apache-2.0/MIT", true),
        ("MIT AND GPL-3.0", false),
        ("(MIT OR GPL-3.0) AND Unicode-3.0", true),
        ("GPL-3.0 OR MIT AND Unicode-3.0", true),
        ("Apache-2.0", false),
        ("Apache-2.0 WITH LLVM-exception OR GPL-3.0", true),
        ("(MIT", false),
        ("MIT MIT", false),
        ("", false),
    ] {
        assert_eq!(met(expression, &allowed), right, "{expression}");
    }
}
