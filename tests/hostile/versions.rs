//! Files of an earlier version, kept in `fixtures`: each is read, or refused in one line with the remedy.

use crate::calls::{run, told};
use std::fs;
use std::path::Path;
use std::process::Output;
use tempfile::TempDir;

/// Copies a folder with all that is in it.
fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().flatten() {
        let (path, place) = (entry.path(), to.join(entry.file_name()));
        match path.is_dir() {
            true => copy(&path, &place),
            false => drop(fs::copy(&path, &place).unwrap()),
        }
    }
}

/// A copy of the files, since calls may write beside them.
fn place() -> TempDir {
    let place = tempfile::tempdir().unwrap();
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/hostile/fixtures/8961e62");
    copy(&fixtures, place.path());
    place
}

fn succeeds(folder: &Path, words: &str) -> Output {
    let output = run(folder, words);
    assert!(output.status.success(), "{words}: {}", told(&output));
    output
}

/// Asserts one line that names the place and the remedy.
fn refused(folder: &Path, words: &str, parts: &[&str]) {
    let output = run(folder, words);
    let said = told(&output);
    assert_eq!(output.status.code(), Some(2), "{words}: {said}");
    let errors = said.lines().filter(|line| line.starts_with("error: "));
    assert_eq!(errors.count(), 1, "{words}: {said}");
    for part in parts {
        assert!(said.contains(part), "{words}: {part} in {said}");
    }
}

/// The value of the only parameter in the JSON of a result.
fn value(output: &Output, path: &str) -> f64 {
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    json.pointer(path).and_then(|value| value.as_f64()).unwrap()
}

#[test]
fn studies_records_and_effects_are_read() {
    let place = place();
    let at = place.path();
    let fit = succeeds(at, "fit r.csv --study short.toml --json");
    let nu = value(&fit, "/parameters/0/value");
    assert!((nu - 1.5).abs() < 0.2, "{nu}");
    succeeds(at, "fit tanks.csv --study tanks.toml");
    let call = "simulate --study short.toml --theta nu=1.5 --effect effect.toml";
    succeeds(at, call);
}

#[test]
fn an_estimator_estimates() {
    let place = place();
    let at = place.path();
    let estimate = succeeds(at, "estimate r.csv --estimator v.est --json");
    let (nu, error) = (
        value(&estimate, "/theta/final/0"),
        value(&estimate, "/std_error/0"),
    );
    assert!(
        (nu - 1.5).abs() < 3.0 * error && error < 1.0,
        "{nu} ± {error}"
    );
}

/// Rows of a bank are those of its files, and each form trains a network. The same call adds nothing to a whole bank, unless the bits of
/// simulations are others now.
#[test]
fn banks_are_read_in_each_form() {
    let place = place();
    let at = place.path();
    let call = "bank --study short.toml --size 128 --out bank";
    let again = run(at, call);
    match again.status.success() {
        true => assert!(String::from_utf8_lossy(&again.stdout).contains("; 0 new")),
        false => refused(
            at,
            call,
            &["holds the work of another call", "choose another"],
        ),
    }
    for name in ["bank.csv", "bank.npz"] {
        let ending = &name[4..];
        succeeds(at, &format!("merge bank --out again{ending}"));
        let read = |name: &str| fs::read(at.join(name)).unwrap();
        assert!(read(&format!("again{ending}")) == read(name), "{name}");
    }
    for (number, bank) in ["bank", "bank.csv", "bank.npz"].into_iter().enumerate() {
        let train = "pretrain --study short.toml --epochs 1";
        succeeds(at, &format!("{train} --bank {bank} --out {number}.est"));
    }
}

/// Folders of trials and of the paper's table have another layout since.
#[test]
fn folders_of_work_are_refused_with_the_remedy() {
    let place = place();
    let at = place.path();
    for (call, name) in [
        (
            "withheld --study short.toml --trials 2 --kinds none --detection-only",
            "trials",
        ),
        (
            "reproduce --study short.toml --runs 2 --bank-size 100 --epochs 1",
            "paper",
        ),
    ] {
        let parts = [name, "of another version of truetwin", "choose another"];
        refused(at, &format!("{call} --out {name}"), &parts);
    }
}
